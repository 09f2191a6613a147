"""Finds benchmarks, runs them, and records the conditions."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import pkgutil
import platform
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Literal

import psutil

from tests import benchmarks

ROOT: Final = Path(__file__).resolve().parents[3]
"""The checkout; working directory of processes that run modules of its tests."""
_LIBRARIES = ("ros-jazzy-rclpy", "numpy", "numba", "mujoco", "scipy", "ruckig")


class BenchError(Exception):
    """A benchmark cannot run here. The message has the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Aim:
    """A figure's limit and relation to it."""

    relation: Literal["<", "<=", ">", ">="]
    limit: float

    def met(self, value: float) -> bool:
        match self.relation:
            case "<":
                return value < self.limit
            case "<=":
                return value <= self.limit
            case ">":
                return value > self.limit
            case ">=":
                return value >= self.limit


@dataclass(frozen=True, slots=True)
class Result:
    """figures: name with unit -> number. conditions: information needed for comparisons."""

    figures: Mapping[str, float]
    conditions: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Benchmark:
    name: str
    aims: Mapping[str, Aim]
    options: Mapping[str, Any]
    module: ModuleType


def names() -> list[str]:
    """Names of all benchmarks, without importing them."""
    return sorted(item.name for item in pkgutil.iter_modules(benchmarks.__path__) if not item.ispkg)


def describe(name: str) -> str:
    """What a benchmark measures: the first line of its text, read without importing it."""
    text = Path(benchmarks.__file__).with_name(f"{name}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def find(name: str) -> Benchmark:
    """Raises BenchError with the known names if there is no such benchmark, or with the library that it lacks."""
    if name not in names():
        raise BenchError(f"there is no benchmark {name!r}; known: {', '.join(names())}")
    try:
        return _benchmark(importlib.import_module(f"{benchmarks.__name__}.{name}"))
    except ModuleNotFoundError as error:
        raise BenchError(f"{name}: needs {error.name}, which is not installed") from error


def _benchmark(module: ModuleType) -> Benchmark:
    parameters = inspect.signature(module.run).parameters
    return Benchmark(
        name=module.__name__.rpartition(".")[2],
        aims=getattr(module, "AIMS", {}),
        options={name: item.default for name, item in parameters.items()},
        module=module,
    )


def run(benchmark: Benchmark, options: Mapping[str, Any]) -> dict[str, Any]:
    """Runs it and returns ``{"name", "figures", "conditions"}``. Raises BenchError for an unknown option."""
    unknown = sorted(set(options) - set(benchmark.options))
    if unknown:
        known = ", ".join(f"{name}={value}" for name, value in benchmark.options.items()) or "none"
        raise BenchError(f"{benchmark.name} has no option {', '.join(unknown)}; options: {known}")
    conditions = common_conditions()
    began_s = time.monotonic()
    measured = benchmark.module.run(**options)
    conditions |= {
        "options": {**benchmark.options, **options},
        "duration_s": round(time.monotonic() - began_s, 1),
        "load_average_after": os.getloadavg()[0],
        **measured.conditions,
    }
    return {"name": benchmark.name, "figures": dict(measured.figures), "conditions": conditions}


def common_conditions() -> dict[str, Any]:
    """Machine, software, and other load of the machine."""
    return {
        "date": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in _LIBRARIES},
        "commit": _commit(),
        "load_average_before": os.getloadavg()[0],
    }


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """The checkout's commit, with a + for uncommitted changes."""
    try:
        commit = _git("rev-parse", "--short=12", "HEAD")
        return commit + ("+" if _git("status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def percentile(values: list[float], share: float) -> float:
    """The nearest-rank percentile: with 100 values, p99 is the second greatest. Raises BenchError without values."""
    if not values:
        raise BenchError("nothing was measured")
    ordered = sorted(values)
    rank = max(1, -(-len(ordered) * round(share * 10_000) // 10_000))
    return ordered[rank - 1]
