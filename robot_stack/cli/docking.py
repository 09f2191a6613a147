"""docking markers, replay, status."""

from __future__ import annotations

import contextlib
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.safety import Timeout

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from robot_stack.core.docks import Docks
    from robot_stack.docking.tools.page import Page, Paper

docking = typer.Typer(help="Docking: print markers, explain failures, watch.", no_args_is_help=True)


class PaperName(StrEnum):
    A4 = "a4"
    A3 = "a3"


@docking.command()
def markers(
    pdf: Annotated[Path, typer.Option("--pdf", help="File to write.", dir_okay=False)],
    dock: Annotated[str | None, typer.Option("--dock", help="Only this dock of config/docks.yaml.")] = None,
    paper: Annotated[PaperName, typer.Option("--paper", help="Size of the sheets.")] = PaperName.A4,
) -> None:
    """Print the marker boards of config/docks.yaml to scale: an overview of each dock, then a page per marker."""
    from robot_stack.core.docks import load_docks
    from robot_stack.docking.tools.page import PAPERS

    docks = load_docks()
    if dock is not None and dock not in docks.docks:
        raise CommandError(f"there is no dock {dock!r}; known docks: {', '.join(sorted(docks.docks))}", WRONG_USE)
    pages = _pages(docks, [dock] if dock is not None else list(docks.docks), PAPERS[paper.value])
    _write_pdf(pdf, pages)
    print(f"{pdf}: {len(pages)} pages; print at 100 %, without scaling to the page")


def _pages(docks: Docks, names: Sequence[str], paper: Paper) -> list[Page]:
    from robot_stack.docking.tools.board_page import board_page
    from robot_stack.docking.tools.marker_page import DoesNotFit, NoSuchMarker, marker_page

    pages = []
    try:
        for name in names:
            dock = docks.docks[name]
            pages.append(board_page(name, dock, docks.marker_size_m, paper))
            pages += [
                marker_page(docks.dictionary, marker, docks.marker_size_m, name, paper)
                for marker in sorted(dock.markers)
            ]
    except (DoesNotFit, NoSuchMarker) as error:
        raise CommandError(str(error), WRONG_USE) from None
    return pages


def _write_pdf(path: Path, pages: Sequence[Page]) -> None:
    from matplotlib.backends.backend_pdf import PdfPages

    with writing(path), PdfPages(path) as file:
        for page in pages:
            file.savefig(page.figure)


@docking.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="Folder of a recording, or one of its .mcap files.")],
    output: Annotated[
        Path | None, typer.Option("--output", help="Folder of the pictures; by default docking_<recording> here.")
    ] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the numbers into this file.")] = None,
) -> None:
    """Show why a docking failed: states, errors, markers, safety, a verdict in words, plots and images."""
    from robot_stack.cli.docking_replay import replay_recording

    replay_recording(recording, output, json_file)


@docking.command()
def status(
    once: Annotated[bool, typer.Option("--once", help="Print the status now and return.")] = False,
    timeout_s: Timeout = 5.0,
) -> None:
    """Follow /docking/status in one line until Ctrl-C."""
    from robot_stack.cli.nodes.docking_status import watch_docking

    with contextlib.suppress(KeyboardInterrupt):
        watch_docking(_shower(), timeout_s, follow=not once)


def _shower() -> Callable[[str, str], None]:
    """Rewrites one line of a terminal; elsewhere prints a line whenever the state changes."""
    last: list[str] = []

    def show(state: str, line: str) -> None:
        if sys.stdout.isatty():
            print(f"\r\x1b[K{line}", end="", flush=True)
        elif [state] != last:
            print(line, flush=True)
        last[:] = [state]

    return show
