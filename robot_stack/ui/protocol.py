"""Messages that a page may send: JSON objects with a type ``t``; everything else is rejected.

Numbers are finite, strings are short, unknown fields are an error. A message may carry a number ``id`` (0 for no
response); the response repeats it.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, JsonValue, StringConstraints, TypeAdapter, ValidationError

# Size limits of a page's message; the longest is 300 characters, except for missions edited by staff.
MESSAGE_BYTES_MAX = 4096
STAFF_BYTES_MAX = 65_536
# A site of 20 km across, as in mission files.
Coordinate = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Yaw = Annotated[float, Field(ge=-6.2832, le=6.2832)]
Deflection = Annotated[float, Field(ge=-1.0, le=1.0)]
MissionId = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_]{0,63}$")]
OrderId = Annotated[str, StringConstraints(min_length=1, max_length=64)]
Revision = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{0,16}$")]
ZoneName = Annotated[str, StringConstraints(min_length=1, max_length=64)]
Pin = Annotated[str, StringConstraints(pattern=r"^[0-9]{4,12}$")]


class Layer(StrEnum):
    """Data shown by only some pages; subscribed to while such a page is open."""

    PLAN = "plan"
    PEOPLE = "people"
    ZONES = "zones"
    DISPLAY = "display"
    STOP_SOURCES = "stop_sources"
    DIAGNOSTICS = "diagnostics"
    HISTORY = "history"
    RECORDINGS = "recordings"
    EVENTS = "events"
    MISSION_FILES = "mission_files"
    COSTMAP = "costmap"
    OBSTACLES = "obstacles"
    MARKERS = "markers"
    FRONT_IMAGE = "front_image"
    REAR_IMAGE = "rear_image"
    SELF_TEST = "self_test"


BINARY_LAYERS = (Layer.COSTMAP, Layer.OBSTACLES, Layer.FRONT_IMAGE, Layer.REAR_IMAGE)


class Message(BaseModel):
    # lax enough for JSON's one kind of number, strict in everything else
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    id: Annotated[int, Field(ge=0, le=2**31)] = 0


class Alive(Message):
    """The page shows something: 1 Hz."""

    t: Literal["alive"]


class Show(Message):
    """The layers that the page shows now."""

    t: Literal["show"]
    layers: Annotated[list[Annotated[Layer, Field(strict=False)]], Field(max_length=len(Layer))]


class Ready(Message):
    """The page has drawn the last frame of this layer and is ready for the next."""

    t: Literal["ready"]
    layer: Annotated[Layer, Field(strict=False)]


class Stop(Message):
    """Emergency stop."""

    t: Literal["stop"]


class Reset(Message):
    """Releases this screen's emergency stop and requests the safety monitor to release the robot."""

    t: Literal["reset"]


class ClearStop(Message):
    """Clears pressed emergency stop sources that are gone or unknown, after a check on site."""

    t: Literal["clear_stop"]
    source: Annotated[str, StringConstraints(min_length=1, max_length=128)]


class Start(Message):
    t: Literal["start"]
    mission: MissionId


class Ride(Message):
    """A command about the running mission."""

    t: Literal["pause", "resume", "abort"]


class AddOrder(Message):
    """Puts a mission into the queue, not before ``in_min`` minutes; ``now``: in place of the ride under way instead."""

    t: Literal["order"]
    mission: MissionId
    priority: Annotated[int, Field(ge=0, le=255)] = 100
    in_min: Annotated[int, Field(ge=0, le=10_080)] = 0
    now: bool = False


class ChangeOrder(Message):
    """A waiting order: removes it, or moves it by one place."""

    t: Literal["order_remove", "order_up", "order_down"]
    order: OrderId


class Queue(Message):
    """Lets the waiting orders start, one after the other, or holds them."""

    t: Literal["queue_hold", "queue_release"]


class Language(Message):
    """The rider's language, for the external display: after a choice on a rider page, and before its start."""

    t: Literal["language"]
    code: Literal["en", "ja", "zh"]


class Login(Message):
    t: Literal["login"]
    pin: Pin


class Logout(Message):
    t: Literal["logout"]


class Pad(Message):
    """The finger on the dead-man pad, 20 Hz. x forward, y left, turn left. at_ms: the page's own steady clock."""

    t: Literal["pad"]
    x: Deflection
    y: Deflection
    turn: Deflection
    at_ms: Annotated[float, Field(ge=0.0, le=1e13)]


class Lift(Message):
    """The finger has left the pad."""

    t: Literal["lift"]


class Pose(Message):
    """The robot stands here, map."""

    t: Literal["pose"]
    x: Coordinate
    y: Coordinate
    yaw: Yaw


class Goal(Message):
    """Drive here, map."""

    t: Literal["goal"]
    x: Coordinate
    y: Coordinate
    yaw: Yaw


class CancelGoal(Message):
    t: Literal["cancel_goal"]


class Undock(Message):
    """Open the latch and leave the wheelchair, or leave the station or charger."""

    t: Literal["undock"]


class ConfirmDoor(Message):
    """The door for which the robot waits is open, as seen on site: for one passage."""

    t: Literal["confirm_door"]
    name: ZoneName


class CallStaff(Message):
    """A rider calls staff (on), or staff have arrived (off)."""

    t: Literal["call"]
    on: bool


class CheckMission(Message):
    """Requests the errors of a mission that would replace ``was``, by the mission manager's rules for its file."""

    t: Literal["mission_check"]
    mission: dict[str, JsonValue]
    was: MissionId | Literal[""] = ""


class SaveMission(Message):
    """Saves a mission: a new one, or in place of ``was``, whose content the page read at ``revision``."""

    t: Literal["mission_save"]
    mission: dict[str, JsonValue]
    was: MissionId | Literal[""]
    revision: Revision


class DeleteMission(Message):
    t: Literal["mission_delete"]
    mission: MissionId
    revision: Revision


class SaveZone(Message):
    """Adds a zone to the site's file, which the page read at ``revision``. points: corners in order, m, map."""

    t: Literal["zone_save"]
    name: ZoneName
    type: Literal["keepout", "speed", "one_way"]
    points: Annotated[list[tuple[Coordinate, Coordinate]], Field(min_length=3, max_length=64)]
    speed_limit_mps: Annotated[float, Field(ge=0.1, le=10.0)] | None = None
    heading_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None
    revision: Revision


class DeleteZone(Message):
    t: Literal["zone_delete"]
    name: ZoneName
    revision: Revision


class DrawLane(Message):
    """Requests the errors of a new lane, or adds it to the site's graph, which the page read at ``revision``.

    points: of the lane in order, m, map; one at a node's own coordinates is the node.
    """

    t: Literal["lane_check", "lane_save"]
    points: Annotated[list[tuple[Coordinate, Coordinate]], Field(min_length=2, max_length=64)]
    both: bool
    speed_limit_mps: Annotated[float, Field(ge=0.1, le=10.0)] | None = None
    revision: Revision


class DeleteLane(Message):
    """lane: id of one of its edges."""

    t: Literal["lane_delete"]
    lane: Annotated[str, StringConstraints(pattern=r"^[0-9]{1,19}$")]
    revision: Revision


class SelfTest(Message):
    """The guided self test: begins it, or acts on its step number ``step``. A page that stops showing it ends it."""

    t: Literal["self_test"]
    act: Literal["begin", "confirm", "fail", "cancel"]
    step: Annotated[int, Field(ge=0, le=63)] = 0


ClientMessage = Annotated[
    Alive
    | Show
    | Ready
    | Stop
    | Reset
    | ClearStop
    | Start
    | Ride
    | AddOrder
    | ChangeOrder
    | Queue
    | Language
    | Login
    | Logout
    | Pad
    | Lift
    | Pose
    | Goal
    | CancelGoal
    | Undock
    | ConfirmDoor
    | CallStaff
    | CheckMission
    | SaveMission
    | DeleteMission
    | SaveZone
    | DeleteZone
    | DrawLane
    | DeleteLane
    | SelfTest,
    Field(discriminator="t"),
]
_ADAPTER: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)


class Refused(ValueError):
    """No message of this protocol. id: of the message, 0 if it cannot be read."""

    def __init__(self, why: str, text: str | bytes) -> None:
        super().__init__(why)
        try:
            self.id = _Numbered.model_validate_json(text).id
        except (ValueError, RecursionError):
            self.id = 0


class _Numbered(BaseModel):
    id: Annotated[int, Field(strict=True, ge=0, le=2**31)]


def parse(text: str | bytes, bytes_max: int = MESSAGE_BYTES_MAX) -> ClientMessage:
    """The message in a frame. Raises Refused for an invalid one."""
    if len(text) > bytes_max:
        raise Refused(f"longer than {bytes_max} bytes", text)
    try:
        return _ADAPTER.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        raise Refused(f"{'.'.join(map(str, first['loc']))}: {first['type']}", text) from None
    except (ValueError, RecursionError) as error:  # no text, or nested beyond reason
        raise Refused(type(error).__name__, text) from None
