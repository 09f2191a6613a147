"""``robot-stack bench`` without the benchmarks of a checkout."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.cli import bench
from robot_stack.cli.errors import NOT_DONE, CommandError


def test_an_installation_without_tests_has_no_benchmarks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "_ROOT", tmp_path)
    with pytest.raises(CommandError, match=f"there is no folder {tmp_path}/tests/benchmarks") as refused:
        bench.bench()
    assert refused.value.code == NOT_DONE
