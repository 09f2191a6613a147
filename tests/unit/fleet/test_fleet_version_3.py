"""What VDA 5050 3.0.0 has otherwise than 2.1.0."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.resources import files
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from robot_stack.cli.fleet_robots import Outcome, Robot, order_progress
from robot_stack.contract.states import HeldBy
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Kind
from robot_stack.fleet.headers import ConnectionMessages, Headers
from robot_stack.fleet.instant import MAX_STATES, supported
from robot_stack.fleet.link import Topic
from robot_stack.fleet.robot import Safety
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import (
    HEADER,
    PARAMS,
    Bench,
    Data,
    action,
    error_types,
    in_version,
    node,
    node_ids,
    order,
    route,
    statuses,
)

V3 = {"version": Version.V3.value}


@pytest.fixture
def bench() -> Bench:
    return Bench(Version.V3)


def sent(bench: Bench, data: Data) -> Data:
    """Sends an order whose nodes and edges are those of 3.0.0 already."""
    return bench.send(Topic.ORDER, data | V3)


def order_v3(nodes: list[Data], order_id: str = "order_1", **changed: Any) -> Data:
    data = order(nodes, order_id)
    edges = [
        {key: value for key, value in edge.items() if key not in ("startNodeId", "endNodeId")} for edge in data["edges"]
    ]
    return data | V3 | {"edges": edges} | changed


def levels(state: Data) -> dict[str, str]:
    return {error["errorType"]: error["errorLevel"] for error in state["errors"]}


# --- messages of the robot -------------------------------------------------------------------------------------------


def closed(schema: Any) -> Any:
    """With no field but those it names."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    fields = {key: closed(value) for key, value in schema.items()}
    return fields | ({"additionalProperties": False} if isinstance(schema.get("properties"), dict) else {})


def schema_of(topic: Topic, version: Version) -> Any:
    path = files("robot_stack.fleet").joinpath("schemas", version, f"{topic}.schema")
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_field_that_is_sent_is_one_of_3_0(bench: Bench) -> None:
    bench.robot = replace(bench.robot, loaded=True, safety=Safety(True, ("CONTACT", "BATTERY_LOW")))
    bench.manager.reason = "held"
    bench.kernel.connected()
    bench.instant(action("cancelOrder"), action("dance"))
    bench.robot = replace(bench.robot, safety=Safety(False, ()))
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, action("drop")), node("c", 4, 4.0, released=False)]))
    bench.tick()
    messages = ConnectionMessages(Headers(PARAMS.identity, Version.V3, {}), lambda: 1.7e9)
    made = [(Topic.CONNECTION, json.loads(make())) for make in (messages.online, messages.offline, messages.broken)]
    assert [one["connectionState"] for _, one in made] == ["ONLINE", "OFFLINE", "CONNECTION_BROKEN"]
    seen = set()
    for topic, data in (*bench.sent, *made):
        problems = [
            error.message for error in Draft202012Validator(closed(schema_of(topic, Version.V3))).iter_errors(data)
        ]
        assert problems == [], topic
        assert data["version"] == "3.0.0"
        seen.add(topic)
    assert seen == {Topic.STATE, Topic.FACTSHEET, Topic.VISUALIZATION, Topic.CONNECTION}


def test_the_state_has_the_fields_of_3_0(bench: Bench) -> None:
    state = bench.tick()
    assert state["powerSupply"] == {"stateOfCharge": 80.0, "charging": False, "batteryVoltage": 50.0}
    assert state["mobileRobotPosition"] == {
        "x": 0.0,
        "y": 0.0,
        "theta": 0.0,
        "mapId": "yard",
        "localized": True,
        "localizationScore": 0.9,
    }
    assert state["safetyState"] == {"activeEmergencyStop": "NONE", "fieldViolation": False}
    assert (state["actionStates"], state["instantActionStates"]) == ([], [])


def test_a_visualization_names_the_state_before_it(bench: Bench) -> None:
    for _ in range(30):
        bench.tick()
    number, checked = -1, 0
    for topic, data in bench.sent:
        if topic is Topic.STATE:
            number = data["headerId"]
        elif topic is Topic.VISUALIZATION:
            assert data["referenceStateHeaderId"] == number
            checked += 1
    assert checked > 10
    assert number > 0


def test_the_factsheet_says_what_the_robot_has_and_that_it_has_no_zones(bench: Bench) -> None:
    bench.kernel.connected()
    bench.tick()
    sheet = next(data for topic, data in bench.sent if topic is Topic.FACTSHEET)
    kind = sheet["typeSpecification"]
    assert (kind["supportedZones"], kind["mobileRobotKinematics"]) == ([], "OMNIDIRECTIONAL")
    assert kind["navigationTypes"] == ["FREELY_NAVIGATING"]
    actions = {one["actionType"]: one for one in sheet["protocolFeatures"]["mobileRobotActions"]}
    assert set(actions) == {"pick", "drop", "wait", "startCharging", *supported(bench.vehicle)}
    assert actions["pick"]["cancelAllowed"] is True
    assert actions["cancelOrder"]["blockingTypes"] == ["NONE"]


def test_an_unknown_pose_is_an_error_and_a_position_not_to_be_trusted(bench: Bench) -> None:
    bench.robot = replace(bench.robot, pose=None)
    state = bench.tick()
    assert levels(state) == {"LOCALIZATION_ERROR": "FATAL"}
    assert state["mobileRobotPosition"]["localized"] is False


# --- orders ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mine", "other"), [(Version.V2, Version.V3), (Version.V3, Version.V2)])
def test_a_message_of_the_other_version_is_refused(mine: Version, other: Version) -> None:
    bench = Bench(mine)
    data = in_version(Topic.ORDER, order(route("a", "b")), mine) | {"version": other.value}
    bench.send(Topic.ORDER, data)
    assert bench.kernel.record.order is None
    assert len(bench.state["errors"]) == 1


def test_a_new_order_has_the_update_id_0(bench: Bench) -> None:
    assert error_types(bench.order(order(route("a", "b"), update=1))) == ["INVALID_ORDER"]
    assert bench.kernel.record.order is None


@pytest.mark.parametrize("restarts", [False, True])
def test_the_same_update_with_another_content_is_refused(bench: Bench, restarts: bool) -> None:
    data = order(route("a", "b", "c", horizon=1))
    bench.order(data)
    if restarts:
        bench.restart()
    assert error_types(bench.order(data | {"headerId": 2, "timestamp": "2026-05-01T09:31:00.00Z"})) == []
    assert levels(bench.order(order(route("a", "b", "d", horizon=1)))) == {"SAME_ORDER_UPDATE_ID": "WARNING"}
    assert node_ids(bench.state) == ["b", "c"]
    update = order(route("b", "c", first=2, x=2.0), update=1)
    assert error_types(bench.order(update)) == []
    assert error_types(bench.order(update)) == []


def test_the_first_node_is_traversed_also_with_actions(bench: Bench) -> None:
    nodes = [node("a", 0, 0.0, action("wait", duration=1.0)), node("b", 2, 2.0)]
    state = bench.order(order(nodes))
    assert (state["lastNodeId"], node_ids(state)) == ("a", ["b"])
    state = bench.serve(2)
    assert (statuses(state), node_ids(state)) == ({"wait": "FINISHED"}, ["b"])
    assert (node_ids(bench.serve(2)), bench.state["lastNodeId"]) == ([], "b")


def ellipse(a: float, b: float, theta: float = 0.0) -> Data:
    return {"allowedDeviationXY": {"a": a, "b": b, "theta": theta}}


@pytest.mark.parametrize(
    ("position", "kind"),
    [
        ({}, Kind.WAIT),
        (ellipse(0.0, 0.0), Kind.WAIT),
        (ellipse(0.001, 0.001), Kind.WAIT),
        (ellipse(2.0, 0.4), Kind.WAIT),
        (ellipse(2.0, 0.5), Kind.PASS),
        (ellipse(2.0, 0.5) | {"theta": 0.0}, Kind.WAIT),
        (ellipse(2.0, 0.5) | {"theta": 0.0, "allowedDeviationTheta": 0.6}, Kind.PASS),
    ],
)
def test_without_a_deviation_the_robot_comes_as_close_as_it_can(bench: Bench, position: Data, kind: Kind) -> None:
    sent(bench, order_v3([node("a", 0, 0.0), node("b", 2, 2.0, **position), node("c", 4, 4.0)]))
    assert error_types(bench.state) == []
    assert bench.manager.orders[bench.manager.added[0]][0].kind is kind


@pytest.mark.parametrize(
    ("x", "y", "deviation", "reached"),
    [
        (0.4, 0.0, {}, True),
        (0.6, 0.0, {}, False),
        (1.9, 0.0, ellipse(2.0, 0.1), True),
        (0.0, 1.9, ellipse(2.0, 0.1), False),
        (0.0, 1.9, ellipse(2.0, 0.1, 1.5707), True),
        (1.9, 0.01, ellipse(2.0, 0.0), True),
        (1.9, 0.10, ellipse(2.0, 0.0), False),
        (1.4, 1.4, ellipse(2.0, 0.1, 0.785), True),
        (1.4, -1.4, ellipse(2.0, 0.1, 0.785), False),
    ],
)
def test_the_first_node_is_reached_within_its_ellipse(
    bench: Bench, x: float, y: float, deviation: Data, reached: bool
) -> None:
    bench.robot = replace(bench.robot, pose=Pose2(x, y, 0.0))
    state = sent(bench, order_v3([node("a", 0, 0.0, **deviation), node("b", 2, 4.0)]))
    assert error_types(state) == ([] if reached else ["START_NODE_OUT_OF_RANGE"])


@pytest.mark.parametrize(
    ("field", "value", "kind"),
    [
        ("reachOrientationBeforeEntering", True, "UNSUPPORTED_PARAMETER"),
        ("corridor", {"leftWidth": 1.0, "rightWidth": 1.0, "releaseRequired": True}, "UNSUPPORTED_PARAMETER"),
        ("maximumRotationSpeed", "fast", "VALIDATION_FAILURE"),
        ("maxSpeed", "of 2.1", "UNSUPPORTED_PARAMETER"),
    ],
)
def test_what_an_edge_asks_and_the_robot_has_not_is_refused(bench: Bench, field: str, value: Any, kind: str) -> None:
    data = order_v3(route("a", "b"))
    data["edges"][0][field] = value
    assert error_types(sent(bench, data)) == [kind]
    assert bench.kernel.record.order is None


def test_an_action_that_is_to_be_tried_again_is_refused(bench: Bench) -> None:
    wait = action("wait", duration=1.0) | {"blockingType": "SINGLE"}
    state = sent(bench, order_v3([node("a", 0, 0.0), node("b", 2, 2.0, wait | {"retriable": True})]))
    assert levels(state) == {"UNSUPPORTED_PARAMETER": "CRITICAL"}
    assert error_types(sent(bench, order_v3([node("a", 0, 0.0), node("b", 2, 2.0, wait | {"retriable": False})]))) == []


def test_that_the_robot_is_not_available_is_reported_until_it_is(bench: Bench) -> None:
    bench.manager.held_by, bench.manager.reason = HeldBy.STAFF, "held"
    assert levels(bench.order(order(route("a", "b")))) == {"MOBILE_ROBOT_NOT_AVAILABLE": "WARNING"}
    bench.manager.held_by = HeldBy.NOTHING
    assert levels(bench.tick()) == {}


def test_in_service_there_is_no_last_node(bench: Bench) -> None:
    bench.order(order(route("a", "b")))
    assert bench.serve(2)["lastNodeId"] == "b"
    bench.manager.held_by = HeldBy.STAFF
    state = bench.tick()
    assert (state["operatingMode"], state["lastNodeId"]) == ("SERVICE", "")


def test_zones_and_responses_are_not_read(bench: Bench) -> None:
    before = bench.tick()
    for topic in (Topic.ZONE_SET, Topic.RESPONSES):
        bench.send(topic, HEADER | V3 | {"zoneSet": {}, "responses": []})
    assert (bench.state["errors"], bench.state["headerId"]) == ([], before["headerId"])


@pytest.mark.parametrize(
    ("served", "state", "named"), [(0, 4, [("nodeId", "b")]), (1, 4, []), (2, 4, [("nodeId", "c")]), (0, 3, [])]
)
def test_a_node_that_is_not_reached_is_named(bench: Bench, served: int, state: int, named: list[Any]) -> None:
    """Not one in whose action the robot fails, nor where a person ends the mission."""
    wait = action("wait", duration=1.0)
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, wait), node("c", 4, 4.0)]))
    bench.serve(served)
    bench.manager.fail(state)
    bench.tick()
    errors = {error["errorType"]: error for error in bench.state["errors"]}
    unreachable = errors.get("NODE_UNREACHABLE", {"errorLevel": "CRITICAL", "errorReferences": []})
    found = [(one["referenceKey"], one["referenceValue"]) for one in unreachable["errorReferences"]]
    assert [one for one in found if one[0] == "nodeId"] == named
    assert unreachable["errorLevel"] == "CRITICAL"
    assert "ORDER_ABORTED" in errors


# --- instant actions -------------------------------------------------------------------------------------------------


def test_cancel_order_may_name_the_order(bench: Bench) -> None:
    bench.order(order(route("a", "b")))
    state = bench.instant(action("cancelOrder", "c1", orderId="another"))
    assert (statuses(state)["c1"], levels(state)) == ("FAILED", {"NO_ORDER_TO_CANCEL": "WARNING"})
    assert ("actionId", "c1") in [
        (one["referenceKey"], one["referenceValue"]) for one in state["errors"][0]["errorReferences"]
    ]
    assert node_ids(state) == ["b"]
    assert statuses(bench.instant(action("cancelOrder", "c2", orderId=["order_1"])))["c2"] == "FAILED"
    state = bench.instant(action("cancelOrder", "c3", orderId="order_1"))
    assert (statuses(state)["c3"], node_ids(state)) == ("FINISHED", [])
    assert set(error_types(state)) == {"NO_ORDER_TO_CANCEL"}, "until a new order is accepted"
    assert error_types(bench.order(order(route("a", "b"), "second"))) == []


def test_instant_actions_are_kept_until_they_are_cleared(bench: Bench) -> None:
    bench.instant(action("stateRequest", "s1"))
    bench.order(order(route("a", "b")))
    bench.silent = True
    state = bench.instant(action("startPause", "p1"))
    assert statuses(state) == {"s1": "FINISHED", "p1": "RUNNING"}
    assert statuses(bench.instant(action("clearInstantActions", "c1"))) == {"p1": "RUNNING", "c1": "FINISHED"}
    assert bench.state["actionStates"] == []


def test_too_many_instant_actions_are_an_error_until_they_are_cleared(bench: Bench) -> None:
    for index in range(MAX_STATES + 1):
        bench.instant(action("stateRequest", f"s{index}"))
    assert (levels(bench.state), len(bench.state["instantActionStates"])) == (
        {"INSTANT_ACTION_STATES_FULL": "URGENT"},
        MAX_STATES,
    )
    assert error_types(bench.instant(action("clearInstantActions"))) == []


def test_an_instant_action_blocks_nothing(bench: Bench) -> None:
    state = bench.send(Topic.INSTANT_ACTIONS, HEADER | V3 | {"actions": [action("stateRequest")]})  # HARD
    assert (error_types(state), statuses(state)) == (["VALIDATION_FAILURE"], {})


def test_the_old_name_of_an_action_is_unknown(bench: Bench) -> None:
    state = bench.instant(action("initPosition", x=0.0, y=0.0, theta=0.0, mapId="yard", lastNodeId="n"))
    assert levels(state) == {"INVALID_INSTANT_ACTION": "WARNING"}
    assert bench.poses == []


# --- with what was there before, and with the command line -----------------------------------------------------------


def test_an_order_under_way_outlives_a_change_of_the_version() -> None:
    bench = Bench(Version.V2)
    bench.order(order(route("a", "b", "c", horizon=1)))
    bench.instant(action("stateRequest"))
    after = Bench(Version.V3)
    after.disk, after.manager = bench.disk, bench.manager
    after.restart()
    state = after.order(order(route("b", "c", first=2, x=2.0), update=1))
    assert (error_types(state), node_ids(state), statuses(state)) == ([], ["b", "c"], {"stateRequest": "FINISHED"})
    assert node_ids(after.serve(4)) == []


def test_the_command_line_follows_an_order_of_3_0(bench: Bench) -> None:
    data = order_v3(route("a", "b"))
    refused = sent(bench, data | {"orderUpdateId": 1})
    progress = order_progress(data | {"orderUpdateId": 1}, refused, [])
    assert (progress.outcome, progress.accepted) == (Outcome.FAILED, False)
    assert "INVALID_ORDER" in progress.words
    assert order_progress(data, sent(bench, data), []).outcome is Outcome.RUNNING
    assert order_progress(data, bench.serve(3), []).outcome is Outcome.FINISHED
    robot = Robot("uagv/v3/robot_stack/robot_1")
    assert robot.version == "3.0.0"
    robot.messages[Topic.STATE] = bench.state
    assert robot.row()[2:] == ("order_1", "no", "0.00, 0.00 yard", "80 %", "-")
    bench.robot = replace(bench.robot, safety=Safety(True, ("ESTOP_PRESSED",)))
    robot.messages[Topic.STATE] = bench.tick()
    assert robot.row()[-1] == "emergency stop, FATAL ESTOP_PRESSED"
