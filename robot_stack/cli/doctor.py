"""doctor: checks whether this machine is ready for the stack, and prints what to do if not."""

from __future__ import annotations

import json
from enum import Enum
from typing import Annotated

import typer


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
    robot: Annotated[bool, typer.Option("--robot", help="Also the steps of docs/commissioning.md.")] = False,
) -> None:
    """Check this machine, the installation and the configuration. Exit code 1 if something will not work."""
    from robot_stack.cli.checks import Level, examine
    from robot_stack.cli.robot_checks import robot_checks

    findings = examine(robot_checks() if robot else ())
    if as_json:
        entries = [{"check": f.check, "level": f.level.value, "what": f.what, "advice": f.advice} for f in findings]
        print(json.dumps(entries, indent=2))
    else:
        _print(findings)
    raise typer.Exit(1 if any(finding.level is Level.BAD for finding in findings) else 0)


def _print(findings: list) -> None:  # type: ignore[type-arg]
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    colours: dict[Enum, str] = {}
    for finding in findings:
        colour = colours.setdefault(finding.level, {"ok": "green", "note": "yellow", "bad": "red"}[finding.level.value])
        console.print(f"[{colour}]{finding.level.value:>4}[/]  {finding.check}: {finding.what}")
        if finding.advice:
            console.print(f"      -> {finding.advice}")
