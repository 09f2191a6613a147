"""When a scheduled ride agrees with the live ones."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim.settings import SHORT_MISSION
from tests.benchmarks import agreement
from tests.benchmarks.support.framework import BenchError


@pytest.mark.parametrize(("values", "is_outside"), [((9.0, 12.0, 20.0), False), ((9.0, 9.5, 12.0), True)])
def test_the_median_counts(values: tuple[float, ...], is_outside: bool) -> None:
    live = [{"time_s": 10.0}, {"time_s": 15.0}]
    assert agreement.outside("time_s", live, [{"time_s": value} for value in values]) is is_outside


def test_a_demo_that_did_not_arrive_is_no_live_ride(tmp_path: Path) -> None:
    for name, state in (("demo-20261127-050000", "COMPLETED"), ("demo-20261127-051000", "FAILED")):
        (tmp_path / name).mkdir()
        content = {"mission": SHORT_MISSION, "state": state, "figures": {}, "wheelchair": {}}
        (tmp_path / name / "figures.json").write_text(json.dumps(content))
    with pytest.raises(BenchError, match="FAILED"):
        agreement.run(results=str(tmp_path))


def test_one_live_ride_has_no_spread(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match="found 0"):
        agreement.run(results=str(tmp_path))
