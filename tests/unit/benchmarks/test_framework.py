"""Benchmarks are found by name, define their options, and write their results with the conditions."""

from __future__ import annotations

import importlib
import json
import pkgutil
from types import ModuleType

import pytest

from tests import benchmarks
from tests.benchmarks.support import framework
from tests.benchmarks.support.framework import Aim, BenchError, Benchmark, Result, percentile


def benchmark(run: object) -> Benchmark:
    module = ModuleType("fake")
    module.run = run  # type: ignore[attr-defined]
    return framework._benchmark(module)


def test_every_benchmark_is_found_and_described_and_every_part_can_be_imported() -> None:
    for name in framework.names():
        assert framework.find(name).name == name
        assert framework.describe(name)
    names = [item.name for item in pkgutil.walk_packages(benchmarks.__path__, f"{benchmarks.__name__}.")]
    assert len(names) > 70
    for name in names:
        importlib.import_module(name)
    found = framework.find("startup")
    assert found.options == {"runs": 5, "profile": "sim", "cold": True}
    assert found.aims["ready_s_median"] == Aim("<", 4.0)


@pytest.mark.parametrize("name", ["nonsense", "../startup"])
def test_unknown_name_lists_the_known_ones(name: str) -> None:
    with pytest.raises(BenchError, match=r"known: .*startup"):
        framework.find(name)


def test_result_can_be_written_as_json() -> None:
    def run(runs: int = 3) -> Result:
        return Result({"time_ms": 1.5}, {"runs_done": runs})

    result = json.loads(json.dumps(framework.run(benchmark(run), {"runs": 4})))
    assert set(result) == {"name", "figures", "conditions"}
    assert result["name"] == "fake"
    assert result["figures"] == {"time_ms": 1.5}
    conditions = result["conditions"]
    assert conditions["runs_done"] == 4
    assert conditions["options"] == {"runs": 4}
    assert {"cpu", "cores", "python", "versions", "commit", "load_average_before", "date"} <= set(conditions)


def test_unknown_option_is_refused_before_anything_runs() -> None:
    with pytest.raises(BenchError, match="has no option speed; options: runs=3"):
        framework.run(benchmark(lambda runs=3: pytest.fail("ran")), {"speed": 1})


@pytest.mark.parametrize(
    ("relation", "met"),
    [
        ("<", [True, False, False]),
        ("<=", [True, True, False]),
        (">", [False, False, True]),
        (">=", [False, True, True]),
    ],
)
def test_aims(relation: str, met: list[bool]) -> None:
    aim = Aim(relation, 5.0)  # type: ignore[arg-type]
    assert [aim.met(value) for value in (4.9, 5.0, 5.1)] == met


def test_percentile_by_nearest_rank() -> None:
    hundred = [float(value) for value in range(1, 101)]
    assert [percentile(hundred, share) for share in (0.99, 0.5, 1.0)] == [99.0, 50.0, 100.0]
    with pytest.raises(BenchError, match="nothing was measured"):
        percentile([], 0.99)
