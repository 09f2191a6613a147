"""Benchmarks: figures and the conditions of their measurement.

Each module of this package is the benchmark of its name, with

    AIMS: dict[str, Aim]            optional: limits of its figures
    run(**options) -> Result        measures; its keyword arguments with defaults are the options

``robot-stack bench NAME --json FILE`` writes ``{"name", "figures", "conditions"}``. ``support`` contains the framework
and what several benchmarks, or long ones, are made of, ``nodes`` what communicates with the stack.
"""
