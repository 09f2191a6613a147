"""Instant actions (VDA 5050 2.1.0, 6.8.1, 6.8.2 and 6.6.3; 3.0.0, 6.1.3 and 6.2)."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from robot_stack.contract.states import MissionState
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.instant import MAX_STATES, REFUSED
from robot_stack.fleet.link import Topic
from robot_stack.fleet.progress import Operation
from robot_stack.fleet.record import Phase
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import (
    HEADER,
    PARAMS,
    Bench,
    Data,
    action,
    error_types,
    node,
    node_ids,
    order,
    route,
    statuses,
)

POSE = {"x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "yard", "lastNodeId": "n"}


@pytest.fixture(params=list(Version))
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


@pytest.fixture
def riding(bench: Bench) -> Bench:
    bench.order(order([*route("a", "b"), node("c", 4, 4.0, action("wait", duration=1.0)), node("d", 6, 6.0)]))
    bench.serve()
    return bench


def is_refused(bench: Bench, entry: Data, kind: ErrorType = ErrorType.INSTANT_ACTION) -> str:
    """The description."""
    state = bench.instant(entry)
    errors = [error for error in state["errors"] if [error["errorType"]] == bench.named(kind)]
    assert statuses(state)[entry["actionId"]] == "FAILED"
    references = [(one["referenceKey"], one["referenceValue"]) for one in errors[0]["errorReferences"]]
    assert ("actionId", entry["actionId"]) in references
    assert errors[0]["errorLevel"] == "WARNING"
    description: str = errors[0]["errorDescription"]
    return description


def position_action(bench: Bench, action_id: str = "pose", **parameters: Any) -> Data:
    return action("initializePosition" if bench.version is Version.V3 else "initPosition", action_id, **parameters)


# --- cancelOrder -----------------------------------------------------------------------------------------------------


def test_cancel_order_ends_the_order(riding: Bench) -> None:
    state = riding.instant(action("cancelOrder"))
    assert statuses(state) == {"wait": "FAILED", "cancelOrder": "FINISHED"}
    assert (state["nodeStates"], state["edgeStates"]) == ([], [])
    assert (state["orderId"], state["orderUpdateId"], state["lastNodeId"]) == ("order_1", 0, "b")
    assert error_types(state) == []


def test_cancel_order_runs_until_the_robot_stands(riding: Bench) -> None:
    riding.robot = replace(riding.robot, twist=Twist2(0.5, 0.0, 0.0))
    assert statuses(riding.instant(action("cancelOrder")))["cancelOrder"] == "RUNNING"
    riding.robot = replace(riding.robot, twist=Twist2(0.0, 0.0, 0.0))
    assert statuses(riding.tick())["cancelOrder"] == "FINISHED"


def test_cancel_order_is_repeated_while_the_mission_manager_refuses(riding: Bench) -> None:
    edit = riding.manager.edit
    riding.manager.edit = lambda request: (False, "to the safe place first")  # type: ignore[method-assign]
    assert statuses(riding.instant(action("cancelOrder")))["cancelOrder"] == "RUNNING"
    riding.manager.edit = edit  # type: ignore[method-assign]
    for _ in range(4):
        riding.tick()
    assert statuses(riding.state)["cancelOrder"] == "FINISHED"
    assert riding.kernel.record.order is not None
    assert riding.kernel.record.order.phase is Phase.CANCELLED


@pytest.mark.parametrize("cancelled", [False, True])
def test_without_an_order_there_is_nothing_to_cancel_or_pause(bench: Bench, cancelled: bool) -> None:
    if cancelled:
        bench.order(order(route("a", "b")))
        bench.instant(action("cancelOrder", "first"))
    is_refused(bench, action("cancelOrder"), ErrorType.NO_ORDER_TO_CANCEL)
    is_refused(bench, action("startPause"))


def test_an_order_that_waits_for_an_update_can_be_cancelled(bench: Bench) -> None:
    bench.order(order(route("a", "b", horizon=1)))
    assert bench.manager.orders == {}
    state = bench.instant(action("cancelOrder"))
    assert (node_ids(state), statuses(state)) == ([], {"cancelOrder": "FINISHED"})


def test_an_order_that_never_reached_the_mission_manager_can_be_cancelled(bench: Bench) -> None:
    bench.silent = True
    bench.order(order(route("a", "b")))
    bench.instant(action("cancelOrder"))
    bench.silent = False
    for _ in range(6):
        bench.tick()
    assert statuses(bench.state) == {"cancelOrder": "FINISHED"}
    assert bench.manager.orders == {}


@pytest.mark.parametrize("deviation_m", [0.0, 5.0])
def test_a_new_order_begins_where_the_robot_stands_or_at_the_last_node(riding: Bench, deviation_m: float) -> None:
    """Both methods of 6.6.3.1."""
    riding.robot = replace(riding.robot, pose=Pose2(3.0, 0.0, 0.0))
    riding.instant(action("cancelOrder"))
    first = node("b", 0, 2.0, allowedDeviationXY=deviation_m) if deviation_m else node("temporary", 0, 3.0)
    state = riding.order(order([first, node("d", 2, 6.0)], "second"))
    assert (state["orderId"], error_types(state)) == ("second", [])
    kept = {"cancelOrder": "FINISHED"} if riding.version is Version.V3 else {}
    assert statuses(state) == kept  # those of the order before are gone


# --- pause -----------------------------------------------------------------------------------------------------------


def test_the_fleet_pauses_and_goes_on(riding: Bench) -> None:
    state = riding.instant(action("startPause", "p1"))
    assert (statuses(state)["p1"], state["paused"]) == ("FINISHED", True)
    assert statuses(riding.instant(action("startPause", "p2")))["p2"] == "FINISHED"
    assert [request.operation for request in riding.manager.asked].count(Operation.PAUSE) == 1
    state = riding.instant(action("stopPause"))
    assert (statuses(state)["stopPause"], state["paused"]) == ("FINISHED", False)
    assert node_ids(riding.serve(4)) == []


@pytest.mark.parametrize("paused", [False, True])
def test_pauses_and_their_ends_in_one_message_are_carried_out_in_their_sequence(riding: Bench, paused: bool) -> None:
    if paused:
        riding.instant(action("startPause", "before"))
    kinds = ["startPause", "stopPause"]
    first, second = reversed(kinds) if paused else kinds
    riding.instant(action(first, "one"), action(second, "two"))
    for _ in range(5):
        riding.tick()
    assert (statuses(riding.state)["one"], statuses(riding.state)["two"]) == ("FINISHED", "FINISHED")
    assert riding.state["paused"] is paused
    asked = [request.operation for request in riding.manager.asked]
    assert asked[-2 - paused :] == [Operation.PAUSE, Operation.RESUME, Operation.PAUSE][: 2 + paused]


def test_the_pause_of_a_person_is_not_ended_by_the_fleet(riding: Bench) -> None:
    riding.manager.state = MissionState.PAUSED
    riding.tick()
    assert "person" in is_refused(riding, action("stopPause"))
    assert riding.manager.state == MissionState.PAUSED


def test_a_refused_pause_fails(riding: Bench) -> None:
    riding.manager.edit = lambda request: (False, "already stopped")  # type: ignore[method-assign]
    state = riding.instant(action("startPause"))
    assert statuses(state)["startPause"] == "FAILED"
    assert "already stopped" in [
        one.get("resultDescription", one.get("actionResult"))
        for one in (*state["actionStates"], *state.get("instantActionStates", ()))
    ]


# --- requests --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "topic"), [("stateRequest", Topic.STATE), ("factsheetRequest", Topic.FACTSHEET)])
def test_a_request_is_answered(bench: Bench, kind: str, topic: Topic) -> None:
    bench.tick()
    bench.sent.clear()
    assert statuses(bench.instant(action(kind)))[kind] == "FINISHED"
    assert topic in [sent for sent, _ in bench.sent]


@pytest.mark.parametrize("kind", [*REFUSED, "pick", "clearErrors", "danceAround"])
def test_what_the_robot_has_not_is_refused_by_name(bench: Bench, kind: str) -> None:
    assert kind in is_refused(bench, action(kind, "one"))


# --- initPosition ----------------------------------------------------------------------------------------------------


def test_a_refusal_is_reported_until_an_instant_action_is_accepted(bench: Bench) -> None:
    bench.instant(action("dance"))
    bench.instant(action("dance"))  # known: ignored
    assert error_types(bench.instant(action("sing"))) == bench.named(*[ErrorType.INSTANT_ACTION] * 2)
    assert error_types(bench.instant(action("stateRequest"), action("jump"))) == bench.named(ErrorType.INSTANT_ACTION)
    assert error_types(bench.instant(action("stateRequest", "again"))) == []


def test_the_pose_is_given_to_localization(bench: Bench) -> None:
    state = bench.instant(position_action(bench, **POSE))
    assert bench.poses == [Pose2(1.0, 2.0, 0.5)]
    assert (statuses(state)["pose"], state["lastNodeId"]) == ("FINISHED", "n")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("x", "far"),
        ("x", 1e9),
        ("x", True),
        ("theta", 4.0),
        ("mapId", "moon"),
        ("lastNodeId", 1),
        ("lastNodeId", "n" * 129),
        *((name, None) for name in POSE),  # is missing
    ],
)
def test_a_pose_that_is_none_is_refused(bench: Bench, field: str, value: object) -> None:
    given = {key: entry for key, entry in (POSE | {field: value}).items() if entry is not None}
    description = is_refused(bench, position_action(bench, **given))
    assert value is not None or field in description
    assert bench.poses == []


@pytest.mark.parametrize("why", ["riding", "accepted", "passenger"])
def test_no_pose_is_set_during_a_mission_or_with_a_passenger(bench: Bench, why: str) -> None:
    bench.robot = replace(bench.robot, loaded=why == "passenger")
    bench.silent = why == "accepted"  # the mission manager has not started the order yet
    if why != "passenger":
        bench.order(order(route("a", "b")))
    is_refused(bench, position_action(bench, **POSE))
    assert bench.poses == []


# --- messages --------------------------------------------------------------------------------------------------------


def test_an_action_that_was_seen_is_not_begun_again(riding: Bench) -> None:
    for _ in range(3):
        riding.instant(position_action(riding, "wait", **POSE), action("startPause", "p"))
    assert riding.poses == []
    assert [request.operation for request in riding.manager.asked].count(Operation.PAUSE) == 1


def test_too_many_actions_in_one_message_are_refused(bench: Bench) -> None:
    state = bench.instant(*(action("stateRequest", f"s{i}") for i in range(PARAMS.limits.instant_actions + 1)))
    assert (error_types(state), statuses(state)) == (bench.named(ErrorType.VALIDATION), {})


def test_the_number_of_states_is_limited_and_running_ones_are_kept(riding: Bench) -> None:
    riding.robot = replace(riding.robot, twist=Twist2(0.5, 0.0, 0.0))
    riding.instant(action("cancelOrder"))
    for index in range(MAX_STATES + 10):
        riding.instant(action("stateRequest", f"s{index}"))
    instant = {key: value for key, value in statuses(riding.state).items() if key != "wait"}
    assert len(instant) == MAX_STATES
    assert instant["cancelOrder"] == "RUNNING"


def test_a_malformed_message_begins_nothing(bench: Bench) -> None:
    entry = {key: value for key, value in action("stateRequest").items() if key != "blockingType"}
    bench.send(
        Topic.INSTANT_ACTIONS, HEADER | {"version": bench.version.value, "actions": [action("factsheetRequest"), entry]}
    )
    assert (error_types(bench.state), statuses(bench.state)) == (bench.named(ErrorType.VALIDATION), {})
    assert error_types(bench.instant(action("stateRequest"))) == []


def test_a_pose_is_not_reported_as_set_if_the_agent_dies_before() -> None:
    bench = Bench()
    position = action("initPosition", x=1.0, y=0.0, theta=0.0, mapId="yard", lastNodeId="n")
    bench.kernel.receive(Topic.INSTANT_ACTIONS, json.dumps(HEADER | {"actions": [position]}).encode())
    bench.compute()
    bench.save()
    bench.restart()
    bench.kernel.connected()
    assert (statuses(bench.tick()), bench.poses) == ({"initPosition": "FAILED"}, [])
    again = bench.instant(position | {"actionId": "again"})
    assert (statuses(again)["again"], bench.poses) == ("FINISHED", [Pose2(1.0, 0.0, 0.0)])
