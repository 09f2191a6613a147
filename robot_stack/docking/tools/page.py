"""Elements of a printed page, in millimetres from its lower left corner."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MM_PER_INCH = 25.4
POINT_PER_MM = 72.0 / MM_PER_INCH


@dataclass(frozen=True, slots=True)
class Paper:
    """A sheet in portrait, mm. margin_mm: the rim on which many printers cannot print."""

    name: str
    width_mm: float
    height_mm: float
    margin_mm: float = 4.0


# ISO 216
PAPERS = {"a4": Paper("A4", 210.0, 297.0), "a3": Paper("A3", 297.0, 420.0)}


@dataclass(frozen=True, slots=True)
class Rect:
    """An area without outline."""

    x_mm: float
    y_mm: float
    width_mm: float
    height_mm: float
    black: bool


@dataclass(frozen=True, slots=True)
class Line:
    """A stroke. arrow: with a head at its end."""

    x0_mm: float
    y0_mm: float
    x1_mm: float
    y1_mm: float
    width_mm: float = 0.2
    arrow: bool = False


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text, placed by the middle of its height."""

    x_mm: float
    y_mm: float
    text: str
    height_mm: float
    align: Literal["left", "center", "right"] = "left"


@dataclass(frozen=True, slots=True)
class Page:
    paper: Paper
    rects: tuple[Rect, ...]
    lines: tuple[Line, ...]
    texts: tuple[Text, ...]


def outline(x_mm: float, y_mm: float, width_mm: float, height_mm: float, stroke_mm: float = 0.2) -> list[Line]:
    """The four sides of a rectangle."""
    right, top = x_mm + width_mm, y_mm + height_mm
    corners = ((x_mm, y_mm), (right, y_mm), (right, top), (x_mm, top), (x_mm, y_mm))
    return [Line(*a, *b, stroke_mm) for a, b in pairwise(corners)]


def draw(page: Page) -> Figure:
    """The page as a figure of exactly its size; saved as PDF it is vectors throughout."""
    from matplotlib.figure import Figure

    paper = page.paper
    figure = Figure(figsize=(paper.width_mm / MM_PER_INCH, paper.height_mm / MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, paper.width_mm)
    axes.set_ylim(0.0, paper.height_mm)
    axes.axis("off")
    _add_rects(axes, page.rects)
    _add_lines(axes, page.lines)
    for text in page.texts:
        # Capital letters are about 0.7 of the font's size.
        points = text.height_mm * POINT_PER_MM / 0.7
        axes.text(text.x_mm, text.y_mm, text.text, fontsize=points, ha=text.align, va="center")
    return figure


def _add_rects(axes: Any, rects: Sequence[Rect]) -> None:
    from matplotlib.patches import Rectangle

    for order, rect in enumerate(rects):
        patch = Rectangle(
            (rect.x_mm, rect.y_mm),
            rect.width_mm,
            rect.height_mm,
            facecolor="black" if rect.black else "white",
            edgecolor="none",
            linewidth=0.0,
            snap=False,  # to whole pixels: the edges stay where they are
            zorder=1.0 + 1e-3 * order,
        )
        axes.add_patch(patch)


def _add_lines(axes: Any, lines: Sequence[Line]) -> None:
    from matplotlib.patches import FancyArrowPatch

    for line in lines:
        ends, stroke = ((line.x0_mm, line.y0_mm), (line.x1_mm, line.y1_mm)), line.width_mm * POINT_PER_MM
        if line.arrow:
            style: dict[str, Any] = {"arrowstyle": "-|>", "mutation_scale": 40.0 * line.width_mm}
            axes.add_patch(FancyArrowPatch(*ends, linewidth=stroke, color="black", shrinkA=0.0, shrinkB=0.0, **style))
        else:
            xs, ys = zip(*ends, strict=True)
            axes.plot(xs, ys, color="black", linewidth=stroke, solid_capstyle="butt")
