"""The external display drawn for people: what it shows as plain data, and as one picture.

The picture is SVG, of one moment or animated; callers that draw without SVG use its cells and places. All in the
units of its viewBox, y down: the band of light above, rear of the robot on the left, pictogram and text below.
"""

from __future__ import annotations

from typing import NamedTuple
from xml.sax.saxutils import escape

from robot_stack.core.display_patterns import BASE_HZ, SEGMENTS, Pattern, Patterns, base_light, light

WIDTH, HEIGHT = 480, 160
_BAND_HEIGHT, ICON_SIZE = 24, 96
ICON_X, TEXT_X = 20, 136
ICON_Y = _BAND_HEIGHT + (HEIGHT - _BAND_HEIGHT - ICON_SIZE) // 2
ICON_SCALE = ICON_SIZE / 24
_TEXT_Y = ICON_Y + ICON_SIZE // 2
PANEL = "#14181C"
_FRAMES = 24  # of one cycle of the animated picture

# Strokes on a grid of 24 x 24, front of the robot to the right.
_WHEELCHAIR = "M8 5a1.6 1.6 0 1 0 .1 0M8 8v6h5l2 5M7 11a5 5 0 1 0 6 7"
PICTOGRAMS = {
    "none": "",
    "robot": "M5 9h14v8H5zM9 9V6h6v3M8 17v2M16 17v2M9 13h.1M15 13h.1",
    "arrow_forward": "M3 12h17M14 6l6 6-6 6",
    "pause": "M8 5v14M16 5v14",
    "battery_charging": "M3 8h16v8H3zM21 11v2M12 8l-3 4h4l-3 4",
    "warning": "M12 3L2 20h20zM12 9v6M12 17.5v.1",
    "stop": "M8 2h8l6 6v8l-6 6H8l-6-6V8zM8 12h8",
    "hand": "M7 13V6M10 12V4M13 12V4M16 13V6M7 13l-2-2M7 13c0 5 2 8 6 8 3 0 5-3 5-8l-2 0",
    "position_unknown": "M12 21c-4-5-6-8-6-11a6 6 0 0 1 12 0c0 3-2 6-6 11zM10.5 8.5a1.6 1.6 0 1 1 1.5 2v1M12 13.5v.1",
    "battery_low": "M3 8h16v8H3zM21 11v2M6 11v2",
    "person_waiting": "M12 3a1.8 1.8 0 1 0 .1 0M12 8v7M12 10l-4 3M12 10l4 3M12 15l-3 6M12 15l3 6",
    "wheelchair_approach": f"{_WHEELCHAIR}M22 12h-5M19 9l-3 3 3 3",
    "wheelchair_dock": f"{_WHEELCHAIR}M22 8v8M17 12h5",
    "check": "M4 13l5 5L20 6",
    "passenger": _WHEELCHAIR,
    "passenger_moving": f"{_WHEELCHAIR}M16 12h6M19 9l3 3-3 3",
    "flag": "M6 21V4M6 4h12l-3 4 3 4H6",
    "wheelchair_undock": f"{_WHEELCHAIR}M16 12h6M19 9l3 3-3 3M15 8v8",
    "wheelchair_failed": f"{_WHEELCHAIR}M17 9l5 6M22 9l-5 6",
}


def description(patterns: Patterns, state: int, language: str, volume: int) -> dict[str, object]:
    """The display's content as plain data. Raises KeyError for a state that has no pattern."""
    pattern = patterns.states[state]
    return {
        "state": state,
        "name": pattern.name,
        "colour": pattern.colour,
        "rgb": patterns.colours[pattern.colour],
        "base_rgb": None if pattern.base == "none" else patterns.colours[pattern.base],
        "motion": pattern.motion,
        "direction": pattern.direction,
        "frequency_hz": pattern.frequency_hz,
        "pictogram": pattern.pictogram,
        "text": pattern.text.get(language),
        "language": language,
        "sound": pattern.sound,
        "volume": volume,
    }


def svg(patterns: Patterns, state: int, language: str, t_s: float | None = None) -> str:
    """The display ``t_s`` seconds after the state began; None: an animated picture.

    Raises KeyError for a state that has no pattern.
    """
    pattern = patterns.states[state]
    rgb = patterns.colours[pattern.colour]
    text = escape(pattern.text.get(language))
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" lang="{language}" role="img">',
            f"<title>{text or escape(pattern.name)}</title>",
            f'<rect width="{WIDTH}" height="{HEIGHT}" rx="12" fill="{PANEL}"/>',
            *(_moving_band(patterns, pattern) if t_s is None else _band(patterns, pattern, t_s)),
            f'<path transform="translate({ICON_X} {ICON_Y}) scale({ICON_SCALE:g})" d="{PICTOGRAMS[pattern.pictogram]}"',
            f'fill="none" stroke="{rgb}" stroke-width="2" stroke-linecap="round" stroke-linejoin="round"/>',
            f'<text x="{TEXT_X}" y="{_TEXT_Y + 9}" fill="#FFFFFF" font-size="{font_size(text)}"'
            f' font-family="sans-serif">{text}</text>',
            "</svg>",
            "",
        ]
    )


class Cell(NamedTuple):
    """A segment of the band: its upper left corner and size."""

    x: float
    y: float
    width: float
    height: float


def cells() -> tuple[Cell, ...]:
    """The segments of the band, rear first."""
    step = (WIDTH - 24) / SEGMENTS
    return tuple(Cell(12 + segment * step, 8, step - 2, _BAND_HEIGHT - 8) for segment in range(SEGMENTS))


def text_middle(text: str) -> tuple[float, float]:
    """Middle of the line of text."""
    return TEXT_X + 0.5 * _letters(text) * font_size(text), float(_TEXT_Y)


def font_size(text: str) -> int:
    """Font size at which the longest text fits."""
    return min(30, int((WIDTH - TEXT_X - 16) / max(_letters(text), 1.0)))


def _letters(text: str) -> float:
    """Width in heights of a letter: one is about half as wide as high, a character of CJK as wide."""
    return sum(0.55 if character.isascii() else 1.0 for character in text)


def _rect(cell: Cell) -> str:
    return f'x="{cell.x:.1f}" y="{cell.y}" width="{cell.width:.1f}" height="{cell.height}" rx="3"'


def _band(patterns: Patterns, pattern: Pattern, t_s: float) -> list[str]:
    base, rgb = patterns.colours[pattern.base], patterns.colours[pattern.colour]
    under = base_light(pattern, t_s)
    found = []
    for cell, brightness in zip(cells(), light(pattern, t_s), strict=True):
        if under > 0.0:
            found.append(f'<rect {_rect(cell)} fill="{base}" opacity="{under:.2f}"/>')
        found.append(f'<rect {_rect(cell)} fill="{rgb}" opacity="{brightness:.2f}"/>')
    return found


def _moving_band(patterns: Patterns, pattern: Pattern) -> list[str]:
    if not pattern.frequency_hz:
        return _band(patterns, pattern, 0.0)
    base, rgb = patterns.colours[pattern.base], patterns.colours[pattern.colour]
    cycle_s = 1.0 / pattern.frequency_hz
    lights = [light(pattern, cycle_s * frame / _FRAMES) for frame in range(_FRAMES + 1)]
    under = [base_light(pattern, frame / (_FRAMES * BASE_HZ)) for frame in range(_FRAMES + 1)]
    # On and off is a step, as it is seen; everything else flows.
    mode = "discrete" if pattern.motion == "blink" else "linear"
    found = []
    for segment, cell in enumerate(cells()):
        if pattern.base != "none":
            found.append(_moving_cell(cell, base, under, 1.0 / BASE_HZ, "linear"))
        found.append(_moving_cell(cell, rgb, [brightness[segment] for brightness in lights], cycle_s, mode))
    return found


def _moving_cell(cell: Cell, colour: str, brightness: list[float], cycle_s: float, mode: str) -> str:
    values = ";".join(f"{value:.2f}" for value in brightness)
    how = f'dur="{cycle_s:g}s" calcMode="{mode}" repeatCount="indefinite"'
    animate = f'<animate attributeName="opacity" values="{values}" {how}/>'
    return f'<rect {_rect(cell)} fill="{colour}" opacity="{brightness[0]:.2f}">{animate}</rect>'
