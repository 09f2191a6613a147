"""bench: measures figures and stores them with their conditions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError


def bench(
    name: Annotated[str | None, typer.Argument(help="Name of the benchmark; without one, they are listed.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the result to this file.")] = None,
    options: Annotated[
        list[str] | None, typer.Option("--option", "-o", metavar="NAME=VALUE", help="An option of the benchmark.")
    ] = None,
) -> None:
    """Run a benchmark and print its figures and aims."""
    from robot_stack.bench import framework

    if name is None:
        for item in framework.find_all():
            print(f"{item.name}: {item.what}")
        return
    try:
        benchmark = framework.find(name)
        result = framework.run(benchmark, _options(options or []))
    except framework.BenchError as error:
        raise CommandError(str(error)) from None
    if json_file is not None:
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    _print(benchmark, result)
    if json_file is not None:
        print(f"written to {json_file}")


def _options(texts: list[str]) -> dict[str, Any]:
    import yaml

    options = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise CommandError(f"--option {text}: must read name=value", WRONG_USE)
        options[name] = yaml.safe_load(value)
    return options


def _print(benchmark: Any, result: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    conditions = result["conditions"]
    table = Table(title=f"{result['name']}: {benchmark.what}", title_justify="left")
    for column in ("figure", "value", "aim", ""):
        table.add_column(column, justify="right" if column == "value" else "left")
    for figure, value in result["figures"].items():
        aim = benchmark.aims.get(figure)
        verdict = "" if aim is None else "[green]met[/]" if aim.met(value) else "[red]missed[/]"
        table.add_row(figure, f"{value:.4g}", "" if aim is None else f"{aim.relation} {aim.limit:g}", verdict)
    console = Console()
    console.print(table)
    console.print(
        f"{conditions['cpu']}, {conditions['cores']} cores, Python {conditions['python']}, "
        f"commit {conditions['commit']}, load {conditions['load_average_before']:.1f} before "
        f"and {conditions['load_average_after']:.1f} after"
    )
