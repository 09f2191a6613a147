"""What a fleet's robots publish, as a table; and how far an order or an instant action has come.

The messages come from other software: a missing or wrong value is shown as absent.
"""

from __future__ import annotations

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

    def row(self) -> tuple[str, ...]:
        state = self.messages.get(Topic.STATE)
        shown = self.messages.get(Topic.VISUALIZATION, {})
        if state is None:
            return (text(self.serial), self.connection, "-", "-", _position(shown), "-", "no state yet")
        order = text(state.get("orderId")) or "-"
        left = len([node for node in _items(state, "nodeStates") if node.get("released")])
        order += f", {left} nodes left" if left else ""
        driving = "paused" if state.get("paused") else "yes" if state.get("driving") else "no"
        errors = [f"{text(item.get('errorLevel'))} {text(item.get('errorType'))}" for item in _items(state, "errors")]
        safety = _inner(state, "safetyState")
        if safety.get("eStop", safety.get("activeEmergencyStop")) not in (None, "NONE"):
            errors.insert(0, "emergency stop")
        position = _position(shown) if _position(shown) != "-" else _position(state)
        return (text(self.serial), self.connection, order, driving, position, _battery(state), ", ".join(errors) or "-")


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
    open_actions = [item for item in actions if item.get("actionStatus") not in ("FINISHED", "FAILED")]
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
    if [item for item in known if item.get("actionStatus") not in ("FINISHED", "FAILED")]:
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
    return value if isinstance(value, int | float) and not isinstance(value, bool) else float("nan")


def _position(data: Data) -> str:
    found = _inner(data, "agvPosition", "mobileRobotPosition")
    x, y = _number(found.get("x")), _number(found.get("y"))
    return "-" if x != x or y != y else f"{x:.2f}, {y:.2f} {text(found.get('mapId'))}".strip()


def _battery(state: Data) -> str:
    found = _inner(state, "batteryState", "powerSupply")
    charge = _number(found.get("batteryCharge", found.get("stateOfCharge")))
    return "-" if charge != charge else f"{charge:.0f} %{', charging' if found.get('charging') else ''}"
