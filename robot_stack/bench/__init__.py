"""Benchmarks: figures and the conditions of their measurement.

A benchmark is a module of this package, or of the simulation's, named like the benchmark, with

    NAME: str                       its name
    AIMS: dict[str, Aim]            optional: limits of its figures
    run(**options) -> Result        measures; its keyword arguments with defaults are the options

``robot-stack bench NAME --json FILE`` writes ``{"name", "figures", "conditions"}``.
"""

from robot_stack.bench.framework import Aim, BenchError, Result

__all__ = ["Aim", "BenchError", "Result"]
