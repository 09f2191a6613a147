"""A saved map folder is loaded unchanged, and errors in it are reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.site_map import FREE, OCCUPIED, UNKNOWN, Cells, Grid, SiteMap, load_map, save_map


def a_map() -> SiteMap:
    covariance = np.array([np.diag([1.0, 2.0, 3.0]), [[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]]])
    cells = Cells(
        1.0, np.array([[0, 0, 0], [-1, 2, 0]], np.int32), np.array([[0.5, 0.5, 0.5], [-0.5, 2.25, 0.0]]), covariance,
        np.array([10, 20]),
    )  # fmt: skip
    grid = Grid(0.1, -3.0, 2.0, np.array([[FREE, OCCUPIED, UNKNOWN], [UNKNOWN, FREE, FREE]], np.int8))
    return SiteMap("test", cells, grid, {"rides": 1})


def test_saved_map_is_the_map(tmp_path: Path) -> None:
    save_map(a_map(), tmp_path / "test")
    read = load_map(str(tmp_path / "test"))
    assert read.name == "test"
    assert read.about["rides"] == 1
    np.testing.assert_allclose(read.cells.covariance, a_map().cells.covariance, rtol=1e-6)
    np.testing.assert_array_equal(read.cells.key, a_map().cells.key)
    np.testing.assert_array_equal(read.grid.occupancy, a_map().grid.occupancy)
    assert (read.grid.resolution_m, read.grid.origin_x_m, read.grid.origin_y_m) == (0.1, -3.0, 2.0)


@pytest.mark.parametrize("file", ["cells.npz", "grid.pgm", "grid.yaml"])
def test_changed_map_is_refused(tmp_path: Path, file: str) -> None:
    save_map(a_map(), tmp_path / "test")
    path = tmp_path / "test" / file
    path.write_bytes(path.read_bytes() + b" ")
    with pytest.raises(ConfigError, match=file):
        load_map(str(tmp_path / "test"))


def test_map_without_checksums_is_refused(tmp_path: Path) -> None:
    save_map(a_map(), tmp_path / "test")
    (tmp_path / "test" / "map.yaml").write_text("name: test\n")
    with pytest.raises(ConfigError, match="no checksums"):
        load_map(str(tmp_path / "test"))
    with pytest.raises(ConfigError, match="no map 'nowhere'"):
        load_map("nowhere")
