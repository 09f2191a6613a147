"""What a fleet's robots publish, as a table and for the fleet page; and how far an order or an instant action has come.

The messages come from other software: a missing or wrong value is shown as absent.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version

Data = Mapping[str, Any]
PUBLISHED: Final = (Topic.CONNECTION, Topic.STATE, Topic.VISUALIZATION, Topic.FACTSHEET)
COLUMNS: Final = ("robot", "connection", "order", "driving", "position", "battery", "errors")
_SHOWN: Final = 60
# How types of errors about a message begin, in 2.1 and from 3.0 on.
_REFUSALS: Final = (
    *("order", "validation", "noRoute"),
    *("VALIDATION", "UNSUPPORTED", "INVALID_ORDER", "INSUFFICIENT", "OTHER_ORDER", "MOBILE_ROBOT_NOT", "UNKNOWN_MAP"),
    *("START_NODE", "NO_ROUTE", "OUTDATED", "SAME_ORDER", "ORDER"),
)
STALE_S: Final = 35.0  # VDA 5050: a state every 30 s at least
_ERRORS_MAX: Final = 20
_NODES_MAX: Final = 500
_FARTHEST_M: Final = 1e6
_LINKS: Final = {
    "ONLINE": "online",
    "OFFLINE": "offline",
    "HIBERNATING": "offline",
    "CONNECTIONBROKEN": "lost",
    "CONNECTION_BROKEN": "lost",
}


@dataclass(slots=True)
class Robot:
    """prefix: its topic without the last level. messages: the last of each topic."""

    prefix: str
    messages: dict[Topic, Data] = field(default_factory=dict)

    @property
    def manufacturer(self) -> str:
        return self.prefix.split("/")[-2]

    @property
    def serial(self) -> str:
        return self.prefix.split("/")[-1]

    @property
    def version(self) -> str:
        """Of the protocol: from any of its messages, otherwise from its topics."""
        of_topics = self.prefix.split("/")[1].removeprefix("v")
        known = Version.of(of_topics) or of_topics
        return next((str(data["version"]) for data in self.messages.values() if "version" in data), str(known))

    @property
    def connection(self) -> str:
        return text(self.messages.get(Topic.CONNECTION, {}).get("connectionState")) or "unknown"

    @property
    def order(self) -> str:
        """Its id, as it is shown; empty without one."""
        return text(self.messages.get(Topic.STATE, {}).get("orderId"))

    def row(self) -> tuple[str, ...]:
        state = self.messages.get(Topic.STATE)
        shown = self.messages.get(Topic.VISUALIZATION, {})
        if state is None:
            return (text(self.serial), self.connection, "-", "-", _position(shown), "-", "no state yet")
        order = self.order or "-"
        left = len([node for node in _items(state, "nodeStates") if node.get("released")])
        order += f", {left} nodes left" if left else ""
        driving = "paused" if state.get("paused") else "yes" if state.get("driving") else "no"
        errors = [f"{text(item.get('errorLevel'))} {text(item.get('errorType'))}" for item in _items(state, "errors")]
        if _stop_kind(state) not in (None, "NONE"):
            errors.insert(0, "emergency stop")
        position = _position(shown) if _position(shown) != "-" else _position(state)
        return (text(self.serial), self.connection, order, driving, position, _charge(state), ", ".join(errors) or "-")


def section(robot: Robot, received_s: Mapping[Topic, float], now_s: float) -> dict[str, Any]:
    """A robot for the fleet page, as JSON: short texts, finite numbers.

    received_s: steady time of each topic's last message. pose: [x, y, yaw] in m and rad in the map ``map``, or None;
    yaw may be None. way: [x, y, released] of each node left on this map. progress: share of the order's nodes reached.
    """
    state = robot.messages.get(Topic.STATE, {})
    newest = max((received_s.get(topic, -math.inf) for topic in (Topic.STATE, Topic.VISUALIZATION)), default=-math.inf)
    age_s = now_s - newest
    stale = math.isfinite(age_s) and age_s > STALE_S
    pose, map_id = _newest_pose(robot, received_s)
    charge, charging = _battery(state)
    nodes = sorted(_items(state, "nodeStates")[:_NODES_MAX], key=_sequence)
    is_open = bool(nodes) or bool(_unfinished(_items(state, "actionStates")))
    errors = _items(state, "errors")
    return {
        "serial": text(robot.serial),
        "maker": text(robot.manufacturer),
        "condition": _condition(robot, state, stale, is_open),
        "mode": text(state.get("operatingMode")),
        # In steps: otherwise each second would be a change to send.
        "age_s": 10 * int(age_s / 10) if stale else 0,
        "pose": pose,
        "map": map_id,
        "battery": round(charge) if 0.0 <= charge <= 100.0 else None,
        "charging": charging is True,
        "loaded": bool(_items(state, "loads")),
        "order": robot.order,
        "open": is_open,
        "progress": _share(state, nodes),
        "left": len(nodes),
        "way": [place for node in nodes if (place := _place(node, map_id)) is not None],
        "errors": [
            {name: text(item.get(f"error{name.title()}")) for name in ("level", "type", "description")}
            for item in errors[:_ERRORS_MAX]
        ],
        "errors_more": max(0, len(errors) - _ERRORS_MAX),
    }


def _condition(robot: Robot, state: Data, stale: bool, is_open: bool) -> str:
    """The one thing to know about it, the most urgent first."""
    link = _LINKS.get(robot.connection, "unknown")
    stop_kind = _stop_kind(state, "NONE")
    # From 3.0 on, CRITICAL may also be an order that the robot refused.
    fatal = any(item.get("errorLevel") == "FATAL" for item in _items(state, "errors"))
    found = (
        (link != "online", link),
        (stale, "stale"),
        (not state, "no_state"),
        (stop_kind == "AUTOACK", "obstacle"),
        (stop_kind != "NONE", "emergency"),
        (fatal, "fault"),
        (state.get("paused") is True, "paused"),
        (state.get("driving") is True, "driving"),
        (is_open, "working"),
        (_battery(state)[1] is True, "charging"),
    )
    return next((name for holds, name in found if holds), "idle")


def _newest_pose(robot: Robot, received_s: Mapping[Topic, float]) -> tuple[list[float | None] | None, str]:
    topics = sorted(
        (Topic.STATE, Topic.VISUALIZATION), key=lambda topic: received_s.get(topic, -math.inf), reverse=True
    )
    for topic in topics:
        found = _inner(robot.messages.get(topic, {}), "agvPosition", "mobileRobotPosition")
        if (xy := _xy(found)) is not None:
            yaw = _number(found.get("theta"))
            return [*xy, None if math.isnan(yaw) else round(math.remainder(yaw, math.tau), 3)], text(found.get("mapId"))
    return None, ""


def _xy(data: Data) -> tuple[float, float] | None:
    x, y = _number(data.get("x")), _number(data.get("y"))
    return (round(x, 3), round(y, 3)) if abs(x) <= _FARTHEST_M and abs(y) <= _FARTHEST_M else None


def _place(node: Data, map_id: str) -> list[float | bool] | None:
    found = _inner(node, "nodePosition")
    xy = _xy(found)
    if xy is None or text(found.get("mapId")) != map_id:
        return None
    return [*xy, node.get("released") is True]


def _sequence(node: Data) -> float:
    number = _number(node.get("sequenceId"))
    return math.inf if math.isnan(number) else number


def _share(state: Data, nodes: Sequence[Data]) -> float | None:
    """Of the order's nodes, from 0 to 1; None without an order. Sequence ids begin with 0 and count edges too."""
    if not state.get("orderId"):
        return None
    if not nodes:
        return 1.0
    last, end = _number(state.get("lastNodeSequenceId")), _sequence(nodes[-1])
    return round(last / end, 3) if 0.0 <= last < end < math.inf else 0.0


def robot_of(topic: str) -> tuple[str, Topic] | None:
    """(prefix, last level) of a topic on which robots publish."""
    prefix, _, last = topic.rpartition("/")
    if prefix.count("/") != 3 or last not in PUBLISHED:
        return None
    return prefix, Topic(last)


class Outcome(Enum):
    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class Progress:
    """accepted: the robot's states name the order or the actions."""

    outcome: Outcome
    words: str
    accepted: bool


def order_progress(order: Data, state: Data, shown_before: Sequence[Data]) -> Progress:
    """Of an order from a state that was received after it. shown_before: errors of the last state before it.

    It is finished if the last released node was reached and every action has ended. It failed if the robot refuses it,
    has taken another, or ended it elsewhere.
    """
    if errors := _errors_about(state, shown_before, order_id=order["orderId"]):
        return Progress(Outcome.FAILED, errors, accepted=False)
    if (state.get("orderId"), state.get("orderUpdateId")) != (order["orderId"], order["orderUpdateId"]):
        newer = (
            state.get("orderId") == order["orderId"] and _number(state.get("orderUpdateId")) > order["orderUpdateId"]
        )
        words = "an update has replaced it" if newer else "not accepted yet"
        return Progress(Outcome.FAILED if newer else Outcome.RUNNING, words, accepted=False)
    nodes = [node for node in _items(state, "nodeStates") if node.get("released")]
    base = [node for node in order["nodes"] if node["released"]]
    ids = {action["actionId"] for part in (*order["nodes"], *order["edges"]) for action in part["actions"]}
    actions = [item for item in _items(state, "actionStates") if item.get("actionId") in ids]
    failed = [item for item in actions if item.get("actionStatus") == "FAILED"]
    open_actions = _unfinished(actions)
    if nodes or open_actions or state.get("driving"):
        return Progress(Outcome.RUNNING, _where(state, len(nodes), open_actions), accepted=True)
    if state.get("lastNodeSequenceId") != base[-1]["sequenceId"]:
        return Progress(Outcome.FAILED, f"ended at node {text(state.get('lastNodeId')) or '-'}", accepted=True)
    if failed:
        return Progress(Outcome.FAILED, f"at its last node; {_actions(failed)}", accepted=True)
    return Progress(Outcome.FINISHED, f"at its last node {text(state.get('lastNodeId'))}", accepted=True)


def actions_progress(message: Data, state: Data, shown_before: Sequence[Data]) -> Progress:
    """Of instant actions, as :func:`order_progress`."""
    ids = [action["actionId"] for action in message["actions"]]
    known = [
        item
        for name in ("actionStates", "instantActionStates")
        for item in _items(state, name)
        if item.get("actionId") in ids
    ]
    if len({item["actionId"] for item in known}) < len(set(ids)):
        errors = next((found for action in ids if (found := _errors_about(state, shown_before, action_id=action))), "")
        return Progress(Outcome.FAILED if errors else Outcome.RUNNING, errors or "not accepted yet", accepted=False)
    if _unfinished(known):
        return Progress(Outcome.RUNNING, _actions(known), accepted=True)
    failed = any(item.get("actionStatus") == "FAILED" for item in known)
    return Progress(Outcome.FAILED if failed else Outcome.FINISHED, _actions(known), accepted=True)


def text(value: object) -> str:
    """A value of a message for a terminal: printable and not long."""
    shown = "" if value is None else str(value)
    shown = "".join(sign if sign.isprintable() else "?" for sign in shown)
    return shown if len(shown) <= _SHOWN else shown[: _SHOWN - 1] + "…"


def _errors_about(
    state: Data, before: Sequence[Data], order_id: str | None = None, action_id: str | None = None
) -> str:
    """New errors that refer to the order or action, in words."""
    key, value = ("orderId", order_id) if order_id is not None else ("actionId", action_id)
    found = [
        item
        for item in _items(state, "errors")
        if item not in before
        and any(
            reference.get("referenceKey") == key and reference.get("referenceValue") == value
            for reference in _items(item, "errorReferences")
        )
        and (key == "actionId" or str(item.get("errorType", "")).startswith(_REFUSALS))
    ]
    return "; ".join(
        ": ".join(filter(None, (text(item.get("errorType")), text(item.get("errorDescription"))))) for item in found
    )


def errors_of(state: Data) -> Sequence[Data]:
    return _items(state, "errors")


def _where(state: Data, nodes_left: int, open_actions: Sequence[Data]) -> str:
    parts = [f"{nodes_left} nodes left"]
    if state.get("lastNodeId"):
        parts.append(f"last node {text(state['lastNodeId'])}")
    if state.get("paused"):
        parts.append("paused")
    if state.get("newBaseRequest"):
        parts.append("requests more of the order")
    running = [item for item in open_actions if item.get("actionStatus") != "WAITING"]
    if running:
        parts.append(_actions(running))
    parts += [f"{text(item.get('errorLevel'))} {text(item.get('errorType'))}" for item in _items(state, "errors")]
    return ", ".join(parts)


def _actions(states: Sequence[Data]) -> str:
    return ", ".join(
        f"{text(item.get('actionType') or item.get('actionId'))} {text(item.get('actionStatus'))}"
        + (f" ({text(result)})" if (result := item.get("resultDescription") or item.get("actionResult")) else "")
        for item in states
    )


def _items(data: Data, name: str) -> list[Data]:
    found = data.get(name)
    return [item for item in found if isinstance(item, dict)] if isinstance(found, list) else []


def _inner(data: Data, *names: str) -> Data:
    return next((data[name] for name in names if isinstance(data.get(name), dict)), {})


def _number(value: object) -> float:
    """NaN unless it is a finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return math.nan
    try:
        return float(value) if math.isfinite(value) else math.nan
    except OverflowError:  # an integer of more than 308 digits
        return math.nan


def _position(data: Data) -> str:
    found = _inner(data, "agvPosition", "mobileRobotPosition")
    x, y = _number(found.get("x")), _number(found.get("y"))
    return "-" if x != x or y != y else f"{x:.2f}, {y:.2f} {text(found.get('mapId'))}".strip()


def _battery(state: Data) -> tuple[float, Any]:
    """(charge in percent, NaN unknown; whether it is charged, as sent)."""
    found = _inner(state, "batteryState", "powerSupply")
    return _number(found.get("batteryCharge", found.get("stateOfCharge"))), found.get("charging")


def _charge(state: Data) -> str:
    charge, charging = _battery(state)
    return "-" if charge != charge else f"{charge:.0f} %{', charging' if charging else ''}"


def _stop_kind(state: Data, missing: str | None = None) -> Any:
    """Of the emergency stop, as sent."""
    safety = _inner(state, "safetyState")
    return safety.get("eStop", safety.get("activeEmergencyStop", missing))


def _unfinished(actions: Sequence[Data]) -> list[Data]:
    return [item for item in actions if item.get("actionStatus") not in ("FINISHED", "FAILED")]
