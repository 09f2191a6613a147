"""What each state of the display looks and sounds like: ``config/ehmi_patterns.yaml``, and the light at any moment.

Shared by the documentation, the simulated display and the user interfaces that draw the display.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from robot_stack.contract.display import Display
from robot_stack.core.config import Config, load

FILE = "ehmi_patterns"
SEGMENTS = 24  # of the band of light, from the rear to the front
BASE_HZ = 0.25
RED_LIMIT_HZ = 2.0
FLASH_LIMIT_HZ = 3.0
_WAVE_SEGMENTS = 8.0  # half of it lit
_DIM = 0.15  # lowest brightness of a breathing band

Motion = Literal["dark", "steady", "breathe", "blink", "travel", "fill"]
Direction = Literal["front", "rear", "centre", "none"]
Colour = Literal["turquoise", "white", "amber", "green", "red", "none"]
Sound = Literal["none", "departure_chime", "fault_tone", "alarm", "soft_tone", "success", "backing_tone"]
Pictogram = Literal[
    "none", "robot", "arrow_forward", "pause", "battery_charging", "warning", "stop", "hand", "position_unknown",
    "battery_low", "person_waiting", "wheelchair_approach", "wheelchair_dock", "check", "passenger",
    "passenger_moving", "flag", "wheelchair_undock", "wheelchair_failed",
]  # fmt: skip
_MOVING = ("breathe", "blink", "travel", "fill")


class Text(Config):
    en: str
    ja: str
    zh: str

    def get(self, language: str) -> str:
        """Raises KeyError for a language that the display does not have."""
        return {"en": self.en, "ja": self.ja, "zh": self.zh}[language]


class Pattern(Config):
    """One state. frequency_hz: cycles of the motion, 0 where nothing moves. base: colour that breathes underneath."""

    name: str
    colour: Colour
    motion: Motion
    pictogram: Pictogram
    text: Text
    reason: Annotated[str, Field(min_length=1)]
    direction: Direction = "none"
    frequency_hz: Annotated[float, Field(ge=0.0, lt=FLASH_LIMIT_HZ)] = 0.0
    base: Colour = "none"
    sound: Sound = "none"
    sources: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if (self.motion in _MOVING) != (self.frequency_hz > 0.0):
            raise ValueError(f"{self.name}: frequency_hz and motion {self.motion} do not fit")
        if (self.motion in ("travel", "fill")) != (self.direction != "none"):
            raise ValueError(f"{self.name}: direction and motion {self.motion} do not fit")
        if self.base != "none" and self.motion != "travel":
            raise ValueError(f"{self.name}: only a travelling wave has a base")
        lit = self.motion != "dark"
        described = self.pictogram != "none" and all((self.text.en, self.text.ja, self.text.zh))
        if lit != (self.colour != "none") or ((lit or self.sound != "none") and not described):
            raise ValueError(f"{self.name}: a colour or a sound needs a pictogram and a text")
        if self.colour == "red" and self.frequency_hz > RED_LIMIT_HZ:
            raise ValueError(f"{self.name}: red must not flash faster than {RED_LIMIT_HZ:g} Hz")
        return self


class Patterns(Config):
    """All states, the colours and the sources they name."""

    colours: dict[Colour, Annotated[str, Field(pattern=r"^#[0-9A-F]{6}$")]]
    sources: dict[str, str]
    states: dict[int, Pattern]

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if set(self.states) != set(Display):
            raise ValueError(f"states: exactly {sorted(map(int, Display))} are needed")
        cited = {key for pattern in self.states.values() for key in pattern.sources}
        if cited != set(self.sources):
            raise ValueError(f"sources: cited or listed, but not both: {sorted(cited ^ set(self.sources))}")
        return self


def load_patterns() -> Patterns:
    """Raises ConfigError."""
    return load(Patterns, FILE)


def light(pattern: Pattern, t_s: float) -> tuple[float, ...]:
    """Brightness [0, 1] of each segment in the pattern's colour, rear first, ``t_s`` after the state began."""
    cycle = pattern.frequency_hz * t_s
    match pattern.motion:
        case "dark":
            return (0.0,) * SEGMENTS
        case "steady":
            return (1.0,) * SEGMENTS
        case "breathe":
            return (_breath(cycle),) * SEGMENTS
        case "blink":
            return (1.0 if cycle % 1.0 < 0.5 else 0.0,) * SEGMENTS
        case "travel":
            return tuple(_wave(_along(pattern.direction, segment), cycle) for segment in range(SEGMENTS))
        case "fill":
            filled = (cycle % 1.0) * SEGMENTS
            return tuple(1.0 if _along(pattern.direction, i) < filled else _DIM for i in range(SEGMENTS))


def base_light(pattern: Pattern, t_s: float) -> float:
    """Brightness [0, 1] of the colour underneath, all segments alike."""
    return 0.0 if pattern.base == "none" else _breath(BASE_HZ * t_s)


def _breath(cycle: float) -> float:
    return _DIM + (1.0 - _DIM) * 0.5 * (1.0 - math.cos(2.0 * math.pi * cycle))


def _along(direction: Direction, segment: int) -> float:
    """How far along its direction a segment lies, in segments."""
    if direction == "rear":
        return float(SEGMENTS - 1 - segment)
    if direction == "centre":
        return 2.0 * min(segment, SEGMENTS - 1 - segment)
    return float(segment)


def _wave(position: float, cycle: float) -> float:
    phase = position / _WAVE_SEGMENTS - cycle
    return max(0.0, math.cos(2.0 * math.pi * phase))
