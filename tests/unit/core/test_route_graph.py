"""Reading a site's route graph, in the format of Nav2's route server."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.route_graph import GRAPH_FILE, graph_files, load_graph, read_graph
from robot_stack.core.site_map import map_folder


def node(index: int, x: float, y: float, **more: Any) -> dict[str, Any]:
    properties = {"id": index, "frame": "map", **more}
    return {"type": "Feature", "properties": properties, "geometry": {"type": "Point", "coordinates": [x, y]}}


def edge(index: int, start: int, end: int, **more: Any) -> dict[str, Any]:
    properties = {"id": index, "startid": start, "endid": end, **more}
    return {"type": "Feature", "properties": properties, "geometry": {"type": "MultiLineString"}}


def written(folder: Path, *features: Any) -> Path:
    path = folder / GRAPH_FILE
    path.write_text(json.dumps({"type": "FeatureCollection", "name": "graph", "features": features}))
    return path


NODES = (node(0, 0.0, 0.0), node(1, 4.0, 3.0, metadata={"region": {"name": "ward"}}, operations={}))


def test_a_graph_is_read(tmp_path: Path) -> None:
    there = edge(10, 0, 1, metadata={"abs_speed_limit": 0.5, "aisle_number": 14})
    back = edge(11, 1, 0, cost=7.0, overridable=False, metadata={"speed_limit": 80.0}, operations={"open_door": {}})
    plain = {**edge(12, 0, 1), "geometry": {"type": "LineString", "coordinates": [[0, 0], [4, 3]]}}
    graph = read_graph(written(tmp_path, *NODES, there, back, plain))
    assert graph is not None
    assert graph.points.tolist() == [[0.0, 0.0], [4.0, 3.0]]
    assert graph.ends.tolist() == [[0, 1], [1, 0], [0, 1]]
    assert graph.edge_ids.tolist() == [10, 11, 12]
    assert math.isnan(graph.cost_m[0])
    assert graph.cost_m[1] == 7.0
    assert graph.speed_mps.tolist() == [0.5, math.inf, math.inf]
    assert graph.speed_share.tolist() == [1.0, 0.8, 1.0]


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ((*NODES, edge(10, 0, 5)), "edge 10: there is no node 5"),
        ((*NODES, edge(1, 0, 1)), "id 1 is used more than once"),
        ((node(0, 1.0, 1.0), node(1, 1.0, 1.0), edge(10, 0, 1)), "edge 10: start and end are the same place"),
        (NODES, "has no edges"),
        ((node(0, 0.0, 0.0, frame="odom"), edge(10, 0, 0)), "features.0.properties.frame"),
        ((*NODES, edge(10, 0, 1, metadata={"abs_speed_limit": 0.0})), "features.2.properties.metadata.abs_speed"),
        ((*NODES, edge(2**63, 0, 1)), "features.2.properties.id"),
        (({"type": "Feature"},), "features.0"),
        ((7,), "features.0"),
    ],
)
def test_a_wrong_graph_is_named(tmp_path: Path, features: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_graph(written(tmp_path, *features))


@pytest.mark.parametrize("content", ["{", "[]", '{"features": 1}', "1" * 5000, "[" * 200_000])
def test_a_file_that_is_no_collection_is_an_error(tmp_path: Path, content: str) -> None:
    path = tmp_path / GRAPH_FILE
    path.write_text(content)
    with pytest.raises(ConfigError, match=str(path)):
        read_graph(path)


def test_a_graph_lies_beside_the_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert load_graph("yard") is None
    folder = shutil.copytree(map_folder("yard"), tmp_path / "yard")
    written(folder, *NODES, edge(10, 0, 1))
    graph = load_graph(str(folder))
    assert graph is not None
    assert len(graph.ends) == 1
    own = graph_files(str(folder)).own
    own.parent.mkdir(parents=True)
    own.write_text(json.dumps({"type": "FeatureCollection", "features": []}))
    assert load_graph(str(folder)) is None, "lanes edited on the robot, down to none, are in force"
