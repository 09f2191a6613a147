"""bench: measures figures and stores them with their conditions."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, write_json

_ROOT = Path(__file__).resolve().parents[2]
_BENCHMARKS = "tests.benchmarks"


def bench(
    name: Annotated[str | None, typer.Argument(help="Name of the benchmark; without one, they are listed.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the result to this file.")] = None,
    options: Annotated[
        list[str] | None, typer.Option("--option", "-o", metavar="NAME=VALUE", help="An option of the benchmark.")
    ] = None,
) -> None:
    """Run a benchmark and print its figures and aims."""
    framework = _framework()
    if name is None:
        for known in framework.names():
            print(f"{known}: {framework.describe(known)}")
        return
    try:
        benchmark = framework.find(name)
        result = framework.run(benchmark, _options(options or []))
    except framework.BenchError as error:
        raise CommandError(str(error)) from None
    if json_file is not None:
        write_json(json_file, result)
    _print(framework.describe(name), benchmark.aims, result)
    if json_file is not None:
        print(f"written to {json_file}")


def _framework() -> Any:
    """Of the checkout's benchmarks, loaded by name: the tests are no part of an installation. Raises CommandError."""
    folder = _ROOT.joinpath(*_BENCHMARKS.split("."))
    if not folder.is_dir():
        raise CommandError(f"the benchmarks belong to a checkout of robot_stack: there is no folder {folder}")
    sys.path.insert(0, str(_ROOT))  # before another package of the name tests
    return importlib.import_module(f"{_BENCHMARKS}.support.framework")


def _options(texts: list[str]) -> dict[str, Any]:
    import yaml

    options = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise CommandError(f"--option {text}: must read name=value", WRONG_USE)
        options[name] = yaml.safe_load(value)
    return options


def _print(what: str, aims: Mapping[str, Any], result: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    conditions = result["conditions"]
    table = Table(title=f"{result['name']}: {what}", title_justify="left")
    for column in ("figure", "value", "aim", ""):
        table.add_column(column, justify="right" if column == "value" else "left")
    for figure, value in result["figures"].items():
        aim = aims.get(figure)
        verdict = "" if aim is None else "[green]met[/]" if aim.met(value) else "[red]missed[/]"
        table.add_row(figure, f"{value:.4g}", "" if aim is None else f"{aim.relation} {aim.limit:g}", verdict)
    console = Console()
    console.print(table)
    console.print(
        f"{conditions['cpu']}, {conditions['cores']} cores, Python {conditions['python']}, "
        f"commit {conditions['commit']}, load {conditions['load_average_before']:.1f} before "
        f"and {conditions['load_average_after']:.1f} after"
    )
