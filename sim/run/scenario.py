"""Scenario files: ``config/scenarios/<name>.yaml``, the events of a run and its expected figures.

A scenario runs the whole stack on the deterministic scheduler. Times are simulated s since the robot could drive.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, ConfigError, config_dir, read_yaml, validate
from robot_stack.core.geometry import Pose2, Twist2
from sim.worldfile import Place, load_world

Seconds = Annotated[float, Field(ge=0.0)]


class TwistAt(Config):
    """Requested twist from ``at_s`` on, base_link."""

    at_s: Seconds
    vx_mps: float = 0.0
    vy_mps: float = 0.0
    omega_radps: float = 0.0

    def twist(self) -> Twist2:
        return Twist2(self.vx_mps, self.vy_mps, self.omega_radps)


class Event(Config):
    """One event at ``at_s``; exactly one of its fields is set.

    fault: a kind of sim.plant.faults with target, value and duration_s. estop: /emergency_stop. reset: /safety/reset.
    goal_again: the present goal is asked for again, as an operator has to after a reset.
    passenger: /passenger_attached. kill: SIGKILL to a process of the stack, by its name.
    """

    at_s: Seconds
    fault: str | None = None
    target: str = ""
    value: float = 0.0
    duration_s: Seconds = 0.0
    estop: bool | None = None
    reset: Literal[True] | None = None
    goal_again: Literal[True] | None = None
    passenger: bool | None = None
    kill: str | None = None

    @model_validator(mode="after")
    def _one_thing(self) -> Event:
        chosen = [name for name in EVENT_KINDS if getattr(self, name) is not None]
        if len(chosen) != 1:
            raise ValueError(f"exactly one of {', '.join(EVENT_KINDS)} must be given, is {', '.join(chosen) or 'none'}")
        if self.fault is None and (self.target or self.value or self.duration_s):
            raise ValueError("target, value and duration_s belong to a fault")
        return self

    def describe(self) -> str:
        if self.fault is not None:
            return " ".join(filter(None, (self.fault, self.target, f"{self.value:g}" if self.value else "")))
        kind = next(name for name in EVENT_KINDS if getattr(self, name) is not None)
        return f"{kind} {getattr(self, kind)}"


EVENT_KINDS = ("fault", "estop", "reset", "goal_again", "passenger", "kill")


class Expectation(Config):
    """Expected value of a figure of the run: a number in a range, or a text."""

    figure: str
    above: float | None = None
    below: float | None = None
    equals: str | bool | None = None

    @model_validator(mode="after")
    def _expects_something(self) -> Expectation:
        if self.above is None and self.below is None and self.equals is None:
            raise ValueError("one of above, below, equals must be given")
        return self

    def problem(self, figures: dict[str, Any]) -> str | None:
        """Why the figures do not meet it; None if they do."""
        if self.figure not in figures:
            return f"{self.figure}: no such figure; there are {', '.join(sorted(figures))}"
        value = figures[self.figure]
        if self.equals is not None:
            return None if value == self.equals else f"{self.figure} must be {self.equals}, is {value}"
        if not isinstance(value, (int, float)):
            return f"{self.figure} must be a number, is {value}"
        if self.above is not None and not value > self.above:
            return f"{self.figure} must be above {self.above:g}, is {value:g}"
        if self.below is not None and not value < self.below:
            return f"{self.figure} must be below {self.below:g}, is {value:g}"
        return None


class Scenario(Config):
    """One file.

    limit_s: ends a run that does not end with its mission or at its last goal. estimated_start: the pose that
    localization starts with, None for the true one. only: processes of the profile to start, all if empty.
    """

    description: str
    world: str
    seed: Annotated[int, Field(ge=0)]
    limit_s: Annotated[float, Field(gt=0.0, le=3600.0)]
    start: Place | None = None
    estimated_start: Place | None = None
    passenger_mass_kg: Annotated[float, Field(ge=0.0)] | None = None
    twists: list[TwistAt] = []
    goals: list[Place] = []
    mission: str | None = None
    events: list[Event] = []
    settings: list[str] = []
    only: list[str] = []
    expect: list[Expectation] = []

    @model_validator(mode="after")
    def _one_request(self) -> Scenario:
        requests = [name for name in ("twists", "goals", "mission") if getattr(self, name)]
        if len(requests) > 1:
            raise ValueError(f"twists, goals and mission exclude each other; given are {', '.join(requests)}")
        return self

    def start_pose(self) -> Pose2:
        """Where the robot starts. Raises ConfigError for an unknown world."""
        return (self.start or load_world(self.world).start).pose()


def load_scenario(path: Path) -> Scenario:
    """Raises ConfigError."""
    return validate(Scenario, read_yaml(path), str(path))


def load_named_scenario(name: str) -> tuple[Scenario, str]:
    """A file, or the name of one in config/scenarios/, and its name. Raises ConfigError."""
    folder = config_dir() / "scenarios"
    path = Path(name)
    if not path.is_file():
        path = folder / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(item.stem for item in folder.glob("*.yaml")))
        raise ConfigError(f"there is no scenario file {name!r}, and no such scenario in {folder}; known: {known}")
    return load_scenario(path), path.stem
