"""The mission model: named waypoints in the map, each with an action.

Lengths in m, yaw in rad, map frame. The YAML form is described in ``config/missions/README.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from enum import Enum
from typing import Annotated, Any

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    StringConstraints,
    field_validator,
    model_serializer,
    model_validator,
)

from robot_stack.core.config import Config
from robot_stack.core.geometry import Pose2
from robot_stack.core.limits import SpeedLimit

MISSION_ID_PATTERN = r"^[a-z0-9][a-z0-9_]{0,63}$"
# Waypoints are counted in a uint8 of /mission/status, the way to home included.
MAX_WAYPOINTS = 254

# A site of 20 km across; a larger value is a typing error.
Coordinate = Annotated[float, Field(strict=True, ge=-10_000.0, le=10_000.0)]
# At most one full turn either way: a value in degrees is rejected instead of read as radians.
Yaw = Annotated[float, Field(strict=True, ge=-6.2832, le=6.2832)]
Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=64)]
# Of a limit on the way to a waypoint, m/s and rad/s.
SLOWEST, FASTEST = 0.1, 10.0
Limit = Annotated[float, Field(strict=True, ge=SLOWEST, le=FASTEST)]
DockId = Annotated[str, StringConstraints(max_length=64)]
MissionId = Annotated[str, StringConstraints(pattern=MISSION_ID_PATTERN)]


class Kind(Enum):
    PASS = "pass"
    WAIT = "wait"
    PARK = "park"
    DOCK = "dock"
    UNDOCK = "undock"


_PLAIN = (Kind.PASS, Kind.PARK, Kind.UNDOCK)
_WITH_VALUE = {Kind.WAIT: "wait_s", Kind.DOCK: "dock_id"}
_FORMS = "pass, park, undock, {wait: seconds} or {dock: id}"


class Action(Config):
    """What happens at a waypoint. Written as ``pass``, ``park``, ``undock``, ``{wait: 5.0}`` or ``{dock: chair_1}``."""

    kind: Kind
    wait_s: Annotated[float, Field(strict=True, ge=0.0, le=86_400.0)] = 0.0
    dock_id: DockId = ""

    @model_validator(mode="before")
    @classmethod
    def _from_yaml(cls, value: Any) -> Any:
        if isinstance(value, str) and value in {kind.value for kind in _PLAIN}:
            return {"kind": value}
        if isinstance(value, dict) and len(value) == 1:
            (word, argument), *_ = value.items()
            field = next((name for kind, name in _WITH_VALUE.items() if kind.value == word), None)
            if field is not None and argument is not None and argument != "":
                return {"kind": word, field: argument}
        raise ValueError(f"must be {_FORMS}")

    @model_serializer
    def _to_yaml(self) -> Any:
        field = _WITH_VALUE.get(self.kind)
        return {self.kind.value: getattr(self, field)} if field else self.kind.value


class Spot(Config):
    """A pose in the map."""

    x: Coordinate
    y: Coordinate
    yaw: Yaw

    @property
    def pose(self) -> Pose2:
        return Pose2(self.x, self.y, self.yaw)


class Home(Spot):
    """Where the robot goes by itself. dock: of a charger, to which it docks from there; empty = it parks."""

    dock: DockId = ""

    @model_serializer(mode="wrap")
    def _without_empty_dock(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields: dict[str, Any] = serialize(self)
        return fields if self.dock else {key: value for key, value in fields.items() if key != "dock"}


class WaypointLabel(Config):
    """Display names of a waypoint in languages other than English; the waypoint's name where none is given."""

    ja: Name | None = None
    zh: Name | None = None


class Waypoint(Spot):
    """A named pose and its action. name: in English; identifies the waypoint.

    max_speed_mps, max_yaw_rate_radps: on the way to it, as far as the robot is not slower by itself.
    """

    name: Name
    label: WaypointLabel = WaypointLabel()
    action: Action
    max_speed_mps: Limit | None = None
    max_yaw_rate_radps: Limit | None = None

    @property
    def limit(self) -> SpeedLimit:
        return SpeedLimit(self.max_speed_mps or math.inf, self.max_yaw_rate_radps or math.inf)

    def names(self) -> dict[str, str]:
        """Its name in each display language."""
        return {"en": self.name, "ja": self.label.ja or self.name, "zh": self.label.zh or self.name}

    @model_serializer(mode="wrap")
    def _without_empty_fields(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Writes label and limits only if they are set, as people write the file."""
        fields: dict[str, Any] = serialize(self)
        label = {language: text for language, text in fields.pop("label").items() if text is not None}
        fields |= {"label": label or None}
        return {key: value for key, value in fields.items() if value is not None}


class LocalName(Config):
    """The mission's name in each display language."""

    en: Name
    ja: Name
    zh: Name


class Mission(Config):
    """A route. ``home`` is where the robot goes by itself after a mission that ended on a low battery."""

    id: MissionId
    name: LocalName
    home: Home
    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1, max_length=MAX_WAYPOINTS)]

    @field_validator("waypoints")
    @classmethod
    def _names_are_unique(cls, waypoints: tuple[Waypoint, ...]) -> tuple[Waypoint, ...]:
        twice = [name for name, count in Counter(waypoint.name for waypoint in waypoints).items() if count > 1]
        if twice:
            raise ValueError(f"every waypoint needs a unique name: {', '.join(twice)} is used more than once")
        return waypoints

    def name_in(self, language: str) -> str:
        """The name for people; English for a language that missions do not have."""
        return str(getattr(self.name, language, self.name.en))


def home_problem(mission: Mission, docks: Mapping[str, str]) -> str:
    """Why the robot cannot dock at the mission's home, as a sentence for people; empty if it can, or parks there.

    docks: kind of each dock by its id.
    """
    dock = mission.home.dock
    if not dock or docks.get(dock) == "charger":
        return ""
    chargers = ", ".join(sorted(name for name, kind in docks.items() if kind == "charger"))
    return f"the home of {mission.id!r}: {dock!r} is no charger; known: {chargers or 'none'}"


def ends_carriage(mission: Mission, docks: Mapping[str, str]) -> bool:
    """True if the route undocks the passenger aboard and docks to no other wheelchair. docks: as ``home_problem``."""
    actions = [waypoint.action for waypoint in mission.waypoints]
    undocks = any(action.kind is Kind.UNDOCK for action in actions)
    return undocks and not any(docks.get(action.dock_id) == "wheelchair" for action in actions)


def aboard_at_start(mission: Mission, attached: bool) -> bool:
    """Whether a mission begins with a passenger, for ``docking_problem``.

    Its first docking or undocking shows it. attached: at present, of a mission without either.
    """
    kinds = [waypoint.action.kind for waypoint in mission.waypoints if waypoint.action.kind in (Kind.DOCK, Kind.UNDOCK)]
    return kinds[0] is Kind.UNDOCK if kinds else attached


def never_dockable(mission: Mission, docks: Mapping[str, str]) -> tuple[int, str] | None:
    """As ``docking_problem``, if it is impossible both with and without a passenger at the start."""
    problem = docking_problem(mission, docks, False)
    return problem if problem is not None and docking_problem(mission, docks, True) is not None else None


def docking_problem(mission: Mission, docks: Mapping[str, str], passenger_attached: bool) -> tuple[int, str] | None:
    """Index of the first waypoint whose docking, undocking or driving on is impossible, and a sentence for people.

    docks: kind of each dock by its id. passenger_attached: at the start.
    """
    aboard, station = passenger_attached, ""
    for index, waypoint in enumerate(mission.waypoints):
        where, kind, dock_id = (
            f"waypoint {waypoint.name!r} of {mission.id!r}",
            waypoint.action.kind,
            waypoint.action.dock_id,
        )
        if kind is Kind.DOCK:
            if dock_id not in docks:
                return index, f"{where}: there is no dock {dock_id!r}; known: {', '.join(sorted(docks)) or 'none'}"
            if aboard or station:
                held = f"docked to {station!r}" if station else "carrying a wheelchair"
                return index, f"{where} docks to {dock_id!r}, but the robot is already {held} then: undock first"
            aboard, station = docks[dock_id] == "wheelchair", "" if docks[dock_id] == "wheelchair" else dock_id
        elif kind is Kind.UNDOCK:
            if not (aboard or station):
                return index, f"{where} undocks, but no wheelchair is attached then and no dock precedes it"
            aboard, station = False, ""
        elif station:
            return index, f"{where} leaves the dock {station!r} without an undock before"
    return None
