"""A printed page, drawn in millimetres from its lower left corner."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Bbox, BboxTransformTo

MM_PER_INCH = 25.4
_POINT_PER_MM = 72.0 / MM_PER_INCH


@dataclass(frozen=True, slots=True)
class Paper:
    """A sheet in portrait, mm. margin_mm: the rim on which many printers cannot print."""

    name: str
    width_mm: float
    height_mm: float
    margin_mm: float = 4.0


# ISO 216
PAPERS = {"a4": Paper("A4", 210.0, 297.0), "a3": Paper("A3", 297.0, 420.0)}


class Page:
    """figure: of exactly the page's size; saved as PDF it is vectors throughout. axes: its area in mm."""

    def __init__(self, width_mm: float, height_mm: float) -> None:
        self.figure = Figure(figsize=(width_mm / MM_PER_INCH, height_mm / MM_PER_INCH))
        self.axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.axes.set(xlim=(0.0, width_mm), ylim=(0.0, height_mm))
        self.axes.axis("off")

    def blacken(self, areas: Iterable[tuple[float, float, float, float]]) -> None:
        """areas: x, y, width and height of rectangles, mm. As one path, adjacent rectangles show no seam."""
        unit = Path.unit_rectangle()
        path = Path.make_compound_path(*(unit.transformed(BboxTransformTo(Bbox.from_bounds(*area))) for area in areas))
        # Snapping would move the edges to whole pixels.
        self.axes.add_patch(PathPatch(path, facecolor="black", linewidth=0.0, snap=False))

    def line(self, x0_mm: float, y0_mm: float, x1_mm: float, y1_mm: float, width_mm: float = 0.2) -> None:
        stroke = width_mm * _POINT_PER_MM
        self.axes.plot((x0_mm, x1_mm), (y0_mm, y1_mm), color="black", linewidth=stroke, solid_capstyle="butt")

    def arrow_up(self, x_mm: float, from_mm: float, to_mm: float, width_mm: float = 0.2) -> None:
        line = {"color": "black", "linewidth": width_mm * _POINT_PER_MM, "shrinkA": 0.0, "shrinkB": 0.0}
        style = {"arrowstyle": "-|>", "mutation_scale": 40.0 * width_mm, **line}
        self.axes.annotate("", (x_mm, to_mm), (x_mm, from_mm), arrowprops=style)

    def text(self, x_mm: float, y_mm: float, text: str, height_mm: float, align: str = "left") -> None:
        """A line of text, placed by the middle of its height."""
        # Capital letters are about 0.7 of the font's size.
        self.axes.text(x_mm, y_mm, text, fontsize=height_mm * _POINT_PER_MM / 0.7, ha=align, va="center")
