"""Pages of results: one HTML file with figures, tables and pictures, without anything from the network."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #12212b; background: #f4f6f7; margin: 0 auto;
  max-width: 70rem; padding: 1.5rem; }
h1 { margin: 0 0 .2rem; } h2 { margin: 2rem 0 .5rem; }
.state { padding: .2rem .8rem; border-radius: 1rem; color: #fff; font-weight: 700; background: #9b1116; }
.state.COMPLETED { background: #1d6b36; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(14rem, 1fr)); gap: .8rem; margin: 1rem 0; }
.figures div { background: #fff; border: 1px solid #a9b6be; border-radius: .5rem; padding: .6rem .9rem; }
.figures b { display: block; font-size: 1.4rem; } .figures span { color: #33454f; }
img { max-width: 100%; border: 1px solid #a9b6be; border-radius: .5rem; background: #fff; }
table { border-collapse: collapse; width: 100%; background: #fff; }
th, td { text-align: left; padding: .35rem .7rem; border-bottom: 1px solid #d7dee2; }
@media (max-width: 40rem) { body { padding: .8rem; } table { display: block; overflow-x: auto; }
  .figures { grid-template-columns: repeat(auto-fill, minmax(9rem, 1fr)); } }
"""


def page(title: str, parts: Iterable[str]) -> str:
    """The whole HTML. parts: of the body, as HTML."""
    return "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<style>{_STYLE}</style></head><body>",
            *parts,
            "</body></html>",
            "",
        ]
    )


def state_line(state: str, text: str) -> str:
    """How it ended, COMPLETED in green."""
    return f'<p><span class="state {escape(state)}">{escape(state)}</span> {escape(text)}</p>'


def figures(items: Iterable[tuple[str, str]]) -> str:
    """items: value and name."""
    cells = (f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in items)
    return f'<div class="figures">{"".join(cells)}</div>'


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Nothing without rows. A cell that begins with ``#`` is a link within the page: ``#target text``."""
    lines = ["".join(f"<td>{_cell(cell)}</td>" for cell in row) for row in rows]
    if not lines:
        return []
    heads = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return [f"<h3>{escape(title)}</h3><table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"]


def _cell(text: str) -> str:
    target, _, shown = text.partition(" ") if text.startswith("#") else ("", "", text)
    return f'<a href="{escape(target)}">{escape(shown)}</a>' if target else escape(shown)


def seconds(time_s: float) -> str:
    if round(time_s, 1) < 60.0:
        return f"{time_s:.1f} s"
    minutes, rest = divmod(round(time_s), 60)
    return f"{minutes} min {rest} s"


def millimetres(error_m: float, error_deg: float | None = None) -> str:
    """Unknown where nothing was measured."""
    if not math.isfinite(error_m):
        return "unknown"
    return f"{1e3 * error_m:.0f} mm" + ("" if error_deg is None else f", {error_deg:.1f}°")
