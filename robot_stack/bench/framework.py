"""Finds benchmarks, runs them, and records the conditions."""

from __future__ import annotations

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
from typing import Any, Literal

import psutil

# The simulation's package is named, not imported: the stack does not depend on it.
PACKAGES = ("robot_stack.bench", "sim.bench")
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
    what: str
    aims: Mapping[str, Aim]
    options: Mapping[str, Any]
    module: ModuleType


def names() -> list[str]:
    """Modules that may be benchmarks, without importing them."""
    found = []
    for package in PACKAGES:
        try:
            path = importlib.import_module(package).__path__
        except ModuleNotFoundError:
            continue
        found += [item.name for item in pkgutil.iter_modules(path) if not item.ispkg]
    return sorted(found)


def find(name: str) -> Benchmark:
    """Raises BenchError with the known names if there is no such benchmark."""
    if name in names():
        for package in PACKAGES:
            try:
                module = importlib.import_module(f"{package}.{name}")
            except ModuleNotFoundError as error:
                if error.name and not error.name.startswith(package.partition(".")[0]):
                    raise BenchError(f"{name}: needs {error.name}, which is not installed") from error
                continue
            if _is_benchmark(module):
                return _benchmark(module)
    raise BenchError(f"there is no benchmark {name!r}; known: {', '.join(item.name for item in find_all())}")


def find_all() -> list[Benchmark]:
    found = []
    for name in names():
        for package in PACKAGES:
            try:
                module = importlib.import_module(f"{package}.{name}")
            except ModuleNotFoundError:
                continue
            if _is_benchmark(module):
                found.append(_benchmark(module))
    return found


def _is_benchmark(module: ModuleType) -> bool:
    return hasattr(module, "NAME") and callable(getattr(module, "run", None))


def _benchmark(module: ModuleType) -> Benchmark:
    parameters = inspect.signature(module.run).parameters
    return Benchmark(
        name=module.NAME,
        what=(module.__doc__ or "").strip().partition("\n")[0],
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
    # A benchmark may return a plain pair instead of a Result.
    figures, own = (measured.figures, measured.conditions) if isinstance(measured, Result) else measured
    conditions |= {
        "options": {**benchmark.options, **options},
        "duration_s": round(time.monotonic() - began_s, 1),
        "load_average_after": os.getloadavg()[0],
        **own,
    }
    return {"name": benchmark.name, "figures": dict(figures), "conditions": conditions}


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
    root = Path(__file__).resolve().parents[2]
    try:
        commit = _git(root, "rev-parse", "--short=12", "HEAD")
        return commit + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def percentile(values: list[float], share: float) -> float:
    """The nearest-rank percentile: with 100 values, p99 is the second greatest. Raises BenchError without values."""
    if not values:
        raise BenchError("nothing was measured")
    ordered = sorted(values)
    rank = max(1, -(-len(ordered) * round(share * 10_000) // 10_000))
    return ordered[rank - 1]
