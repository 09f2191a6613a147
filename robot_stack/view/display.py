"""The external display in the live view: a vertical image above the robot, as seen from its right."""

from __future__ import annotations

import numpy as np
from fontTools.pens.recordingPen import RecordingPen
from fontTools.svgLib.path import parse_path
from foxglove.messages import (
    Color,
    CubePrimitive,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    TextPrimitive,
    Vector3,
)
from numpy.typing import NDArray

from robot_stack.core import display_picture as picture
from robot_stack.core.display_patterns import Pattern, Patterns, base_light, light
from robot_stack.view.params import DisplayParams
from robot_stack.view.scene import entity

Floats = NDArray[np.float64]
_CURVE = np.linspace(0.0, 1.0, 7)[1:, None]
_THICK_M = 0.01
_UPRIGHT = Quaternion(x=np.sqrt(0.5), y=0.0, z=0.0, w=np.sqrt(0.5))  # keeps x, turns y upwards
_WHITE = "#FFFFFF"


class DisplayPanel:
    """The display as a scene entity in base_link: rear of the band towards the robot's rear."""

    def __init__(self, params: DisplayParams, patterns: Patterns) -> None:
        self._params, self._patterns = params, patterns
        self._scale = params.width_m / picture.WIDTH
        self._strokes = {name: strokes(path) for name, path in picture.PICTOGRAMS.items()}

    def entity(self, state: int | None, t_s: float, now_ns: int) -> SceneEntity:
        """The display ``t_s`` seconds after the state began. state None: unknown."""
        panel = self._cube((0.0, 0.0, picture.WIDTH, picture.HEIGHT), picture.PANEL, 1.0, 0.0)
        if state is None or state not in self._patterns.states:
            unknown = self._text(self._params.unknown, 0.5 * picture.WIDTH, 0.5 * picture.HEIGHT, 30)
            return entity("display", now_ns, cubes=[panel], texts=[unknown])
        pattern = self._patterns.states[state]
        text = pattern.text.get(self._params.language)
        written = [self._text(text, *picture.text_middle(text), picture.font_size(text))] if text else []
        cubes = [panel, *self._band(pattern, t_s)]
        return entity("display", now_ns, cubes=cubes, lines=self._icon(pattern), texts=written)

    def _band(self, pattern: Pattern, t_s: float) -> list[CubePrimitive]:
        colours, under = self._patterns.colours, base_light(pattern, t_s)
        lit = []
        for cell, brightness in zip(picture.cells(), light(pattern, t_s), strict=True):
            if under > 0.0:
                lit.append(self._cube(cell, colours[pattern.base], under, _THICK_M))
            if brightness > 0.0:
                lit.append(self._cube(cell, colours[pattern.colour], brightness, 1.5 * _THICK_M))
        return lit

    def _icon(self, pattern: Pattern) -> list[LinePrimitive]:
        return [
            LinePrimitive(
                type=LinePrimitiveLineType.LineStrip,
                pose=Pose(position=Vector3(), orientation=Quaternion(w=1.0)),
                thickness=2.0 * picture.ICON_SCALE * self._scale,
                scale_invariant=False,
                points=[Point3(x=x, y=-_THICK_M, z=z) for x, z in map(self._place, *line.T)],
                color=_colour(self._patterns.colours[pattern.colour], 1.0),
            )
            for line in self._strokes[pattern.pictogram]
        ]

    def _text(self, text: str, x: float, y: float, size: float) -> TextPrimitive:
        at_x, at_z = self._place(x, y)
        return TextPrimitive(
            pose=Pose(position=Vector3(x=at_x, y=-1.5 * _THICK_M, z=at_z), orientation=_UPRIGHT),
            billboard=False,
            font_size=size * self._scale,
            scale_invariant=False,
            color=_colour(_WHITE, 1.0),
            text=text,
        )

    def _cube(
        self, box: tuple[float, float, float, float], colour: str, opacity: float, proud_m: float
    ) -> CubePrimitive:
        """box: left, top, width and height in the image. proud_m: its distance from the display plane."""
        left, top, width, height = box
        x, z = self._place(left + 0.5 * width, top + 0.5 * height)
        return CubePrimitive(
            pose=Pose(position=Vector3(x=x, y=-proud_m, z=z), orientation=Quaternion(w=1.0)),
            size=Vector3(x=width * self._scale, y=_THICK_M, z=height * self._scale),
            color=_colour(colour, opacity),
        )

    def _place(self, x: float, y: float) -> tuple[float, float]:
        """(x, z) in base_link, m, of a point of the image."""
        right_m = (x - 0.5 * picture.WIDTH) * self._scale
        return float(right_m), float(self._params.bottom_m + (picture.HEIGHT - y) * self._scale)


def strokes(path: str) -> list[Floats]:
    """The lines of an SVG path of a pictogram, (n, 2) points each, in the image's units."""
    pen = RecordingPen()
    parse_path(path, pen)
    lines: list[list[Floats]] = []
    for command, points in pen.value:
        ends = [np.array(point, dtype=np.float64) for point in points]
        if command == "moveTo":
            lines.append(ends)
        elif command == "lineTo":
            lines[-1] += ends
        elif command == "curveTo":
            lines[-1] += list(_curve(np.array([lines[-1][-1], *ends])))
        elif command == "closePath":
            lines[-1].append(lines[-1][0])
    corner = np.array([picture.ICON_X, picture.ICON_Y])
    return [corner + picture.ICON_SCALE * np.array(line) for line in lines]


def _curve(ends: Floats) -> Floats:
    """(n, 2) points of a cubic Bezier curve, without its first one; ends: its four points."""
    a, b, c, d = ends
    u, v = 1.0 - _CURVE, _CURVE
    return np.asarray(u**3 * a + 3.0 * u**2 * v * b + 3.0 * u * v**2 * c + v**3 * d)


def _colour(rgb: str, opacity: float) -> Color:
    red, green, blue = bytes.fromhex(rgb[1:])
    return Color(r=red / 255.0, g=green / 255.0, b=blue / 255.0, a=opacity)
