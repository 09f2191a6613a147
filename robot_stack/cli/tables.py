"""Shared layout of the tables of the command line: at most 100 columns wide, long texts below them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

WIDTH = 100
Column = tuple[str, Literal["left", "right"]]


def console() -> Console:
    """A console on standard output, with a fixed width for a pipe."""
    return Console() if sys.stdout.isatty() else Console(width=WIDTH)


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """Call it with (done, total). A bar on a terminal; no output elsewhere."""
    from rich.progress import Progress

    shown = Console(stderr=True)
    with Progress(console=shown, transient=True, disable=not shown.is_terminal) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def table(title: str, columns: Sequence[Column]) -> Table:
    """A table without rows. If it is too wide, cells wrap instead of being cut."""
    made = Table(title=Text(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for name, justify in columns:
        made.add_column(name, justify=justify, overflow="fold")
    return made


def notes(entries: Iterable[tuple[str, str]], style: str = "") -> Table:
    """Subjects and notes on them, wrapped."""
    made = Table.grid(padding=(0, 2))
    made.add_column(overflow="fold", style=style)
    made.add_column(overflow="fold")
    for subject, text in entries:
        made.add_row(Text(subject), Text(text))
    return made
