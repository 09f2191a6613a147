"""Handles every message of every page and passes on the permitted ones. Times are steady seconds."""

from __future__ import annotations

from dataclasses import dataclass

from robot_stack.ui import protocol as p
from robot_stack.ui.access import Access, Role
from robot_stack.ui.pad import DeadManPad

OK = ""
# Answers are keys of the texts that pages show.
NEEDS_STAFF, PAD_BUSY, NO_PIN_SET, WAIT, SLOW_DOWN = (
    "answer.needs_staff",
    "answer.pad_busy",
    "answer.no_pin",
    "answer.wait",
    "answer.too_fast",
)
_EDITS = (p.CheckMission, p.SaveMission, p.DeleteMission, p.SaveZone, p.DeleteZone, p.DrawLane, p.DeleteLane)
_ORDERS = (p.AddOrder, p.ChangeOrder)
_STAFF_ONLY = (
    *(p.Reset, p.ClearStop, p.Pad, p.Pose, p.Goal, p.CancelGoal, p.Undock, p.ConfirmDoor, p.SelfTest),
    *_ORDERS,
    *_EDITS,
)


@dataclass(frozen=True, slots=True)
class Ruling:
    """The decision on a message. effect: the message, if it is to be executed; why: the key of a refusal."""

    effect: p.ClientMessage | None
    why: str = OK
    audit: str = ""


class Desk:
    """Roles, the pad's holder and the flood limit of each page."""

    def __init__(self, access: Access, pad: DeadManPad, messages_hz_max: float) -> None:
        self.access, self.pad = access, pad
        self._rate_hz = messages_hz_max
        self._budgets: dict[int, tuple[float, float]] = {}

    def take(self, client: int, message: p.ClientMessage, now_s: float, *, held_by_staff: bool = False) -> Ruling:
        """The stop is never refused, for any client at any rate.

        held_by_staff: the queue of orders, which a rider may otherwise release.
        """
        within = self._within_budget(client, now_s)
        if isinstance(message, p.Stop):
            return Ruling(message, audit="emergency stop")
        if not within:
            return Ruling(None, SLOW_DOWN)
        staff = self.access.role(client, now_s) is Role.STAFF
        by_staff = _by_staff(message) or (held_by_staff and isinstance(message, p.Queue))
        if not staff and (isinstance(message, _STAFF_ONLY) or by_staff):
            return Ruling(None, NEEDS_STAFF, named(message))
        if not isinstance(message, p.Alive | p.Ready | p.Show):
            self.access.touch(client, now_s)
        return self._rule(client, message, now_s)

    def enter(self, client: int, now_s: float) -> None:
        self.access.enter(client, now_s)

    def leave(self, client: int) -> None:
        """The page is gone."""
        self.pad.forget(client)
        self.access.leave(client)
        self._budgets.pop(client, None)

    def _rule(self, client: int, message: p.ClientMessage, now_s: float) -> Ruling:
        match message:
            case p.Pad():
                return self._drive(client, message, now_s)
            case p.Lift():
                was = self.pad.holder == client
                self.pad.lift(client)
                return Ruling(message if was else None, audit="pad released" if was else "")
            case p.Login():
                return self._login(client, message, now_s)
            case p.Logout():
                self.pad.lift(client)
                self.access.dismiss(client)
        if isinstance(message, _EDITS):
            return Ruling(message)  # its outcome is audited
        return Ruling(message, audit=named(message))

    def _drive(self, client: int, message: p.Pad, now_s: float) -> Ruling:
        before = self.pad.holder
        if not self.pad.press(client, message.x, message.y, message.turn, 1e-3 * message.at_ms, now_s):
            return Ruling(None, PAD_BUSY)
        return Ruling(message, audit="" if before == client else "pad pressed")

    def _login(self, client: int, message: p.Login, now_s: float) -> Ruling:
        if not self.access.pin_set:
            return Ruling(None, NO_PIN_SET, "staff PIN")
        if not self.access.begin_check(client, now_s):
            return Ruling(None, WAIT, "staff PIN")
        return Ruling(message)  # its outcome is audited

    def _within_budget(self, client: int, now_s: float) -> bool:
        """A second's worth of messages may come at once."""
        tokens, since_s = self._budgets.get(client, (self._rate_hz, now_s))
        tokens = min(self._rate_hz, tokens + self._rate_hz * max(0.0, now_s - since_s))
        self._budgets[client] = (max(0.0, tokens - 1.0), now_s)
        return tokens >= 1.0


def _by_staff(message: p.ClientMessage) -> bool:
    """True for messages that need the PIN; their data is not sent to riders either."""
    if isinstance(message, p.CallStaff):
        return not message.on
    if isinstance(message, p.Queue):
        return message.t == "queue_hold"
    return isinstance(message, p.Show) and any(layer is not p.Layer.PLAN for layer in message.layers)


def named(message: p.ClientMessage) -> str:
    """Its name in the audit log; empty for messages that are no operator actions."""
    match message:
        case p.Start():
            return f"start mission {message.mission}"
        case p.AddOrder():
            return f"{'change destination to' if message.now else 'order'} {message.mission}"
        case p.ChangeOrder():
            return f"{message.t.replace('_', ' ')} {message.order}"
        case p.Ride() | p.Queue() | p.Logout() | p.CancelGoal() | p.Reset() | p.Undock():
            return message.t.replace("_", " ")
        case p.Pose() | p.Goal():
            return f"{message.t} {message.x:.2f} {message.y:.2f} {message.yaw:.3f}"
        case p.CallStaff():
            return "staff called" if message.on else "call answered"
        case p.SaveMission():
            renamed = f" (was {message.was})" if message.was and message.was != message.mission.get("id") else ""
            return f"save mission {message.mission.get('id')}{renamed}"
        case p.DeleteMission():
            return f"delete mission {message.mission}"
        case p.SaveZone():
            return f"save zone {message.name}"
        case p.DeleteZone():
            return f"delete zone {message.name}"
        case p.DrawLane():
            (ax, ay), (bx, by) = message.points[0], message.points[-1]
            return f"{message.t.replace('_', ' ')} {ax:.2f} {ay:.2f} to {bx:.2f} {by:.2f}"
        case p.DeleteLane():
            return f"delete lane {message.lane}"
        case p.ConfirmDoor():
            return f"confirm door {message.name}"
        case p.ClearStop():
            return f"clear the emergency stop of {message.source}"
        case p.SelfTest():
            return f"self test: {message.act}" + ("" if message.act == "begin" else f" step {message.step}")
    return ""
