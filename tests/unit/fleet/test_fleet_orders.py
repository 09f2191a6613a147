"""Which orders and updates are taken over: figure 8 and the rules around it (VDA 5050 2.1.0, 6.6; 3.0.0, 6.1)."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract.states import HeldBy
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Kind
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.progress import Operation, Request
from robot_stack.fleet.record import Phase
from robot_stack.fleet.robot import Safety
from robot_stack.fleet.vehicle import Stop
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import (
    EDGES_V3,
    HEADER,
    PARAMS,
    ROBOT,
    VEHICLE,
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

STOP = Stop(0, "", "far", 60.0, 0.0, 0.0, Kind.PARK)


@pytest.fixture(params=list(Version))
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


def is_refused(bench: Bench, data: Data, kind: ErrorType, *named: tuple[str, str]) -> None:
    """The order changes nothing but the errors."""
    before = bench.kernel.record.order
    errors = [error for error in bench.order(data)["errors"] if [error["errorType"]] == bench.named(kind)]
    assert errors, bench.state["errors"]
    levels = {ErrorType.UNSUPPORTED: "CRITICAL", ErrorType.MEMORY: "URGENT"} if bench.version is Version.V3 else {}
    assert errors[0]["errorLevel"] == levels.get(kind, "WARNING")
    references = {(one["referenceKey"], one["referenceValue"]) for one in errors[0]["errorReferences"]}
    assert {("topic", "order"), ("orderId", data["orderId"]), *named} <= references
    assert bench.kernel.record.order == before


# --- 1: valid? -------------------------------------------------------------------------------------------------------


def changed(change: Callable[[Data], Any]) -> Data:
    data = order(route("a", "b", "c", horizon=1))
    change(data)
    return data


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.update(nodes=[], edges=[]),
        lambda data: data["edges"].pop(),
        lambda data: data["nodes"].pop(),
        lambda data: data["nodes"][1].update(sequenceId=3),
        lambda data: data["edges"][0].update(sequenceId=2),
        lambda data: data["nodes"][0].update(sequenceId=2**32),
        lambda data: data.update(orderUpdateId=2**32),
        lambda data: data["nodes"][0].update(released=False),
        lambda data: data["edges"][0].update(released=False),
        lambda data: data["edges"][1].update(released=True),
        lambda data: (data["nodes"][1].update(released=False), data["nodes"][2].update(released=True)),
        lambda data: data.update(orderId=""),
        lambda data: data["nodes"][1].update(nodeId=""),
        lambda data: data["nodes"][1].update(actions=[action("wait", "w", duration=1.0)] * 2),
        lambda data: data.update(version="1.1.0"),
        lambda data: data.update(version="4.0.0"),
        lambda data: data.update(serialNumber="another"),
        lambda data: data.update(manufacturer="another"),
    ],
)
def test_a_malformed_order_is_refused(bench: Bench, change: Callable[[Data], Any]) -> None:
    bench.order(changed(change))
    assert error_types(bench.state) == bench.named(ErrorType.VALIDATION)
    assert bench.kernel.record.order is None


@pytest.mark.parametrize("change", [{"startNodeId": "z"}, {"endNodeId": "z"}])
def test_an_edge_must_connect_its_nodes(change: Data) -> None:
    """From 3.0 on only the sequence says which they are."""
    bench = Bench()
    bench.order(changed(lambda data: data["edges"][0].update(change)))
    assert error_types(bench.state) == bench.named(ErrorType.VALIDATION)


def test_the_error_is_reported_until_an_order_is_accepted(bench: Bench) -> None:
    is_refused(bench, order(route("a", "b", first=2)), ErrorType.VALIDATION)
    for _ in range(50):
        bench.tick()
    assert error_types(bench.state) == bench.named(ErrorType.VALIDATION)
    assert error_types(bench.order(order(route("a", "b")))) == []


# --- 2 to 4: a new order ---------------------------------------------------------------------------------------------


def test_a_new_order_is_taken_over(bench: Bench) -> None:
    state = bench.order(order(route("a", "b", "c", "d", horizon=1), "first"))
    assert (state["orderId"], state["orderUpdateId"]) == ("first", 0)
    assert (state["lastNodeId"], state["lastNodeSequenceId"]) == ("a", 0)
    assert [(one["nodeId"], one["sequenceId"], one["released"]) for one in state["nodeStates"]] == [
        ("b", 2, True),
        ("c", 4, True),
        ("d", 6, False),
    ]
    assert [(one["edgeId"], one["released"]) for one in state["edgeStates"]] == [
        ("a-b", True),
        ("b-c", True),
        ("c-d", False),
    ]


def test_another_order_is_refused_while_one_is_under_way_or_waits_for_an_update(bench: Bench) -> None:
    bench.order(order(route("a", "b", "c", horizon=1)))
    is_refused(bench, order(route("a", "b"), "second"), ErrorType.OTHER_ORDER, ("activeOrderId", "order_1"))
    assert node_ids(bench.serve(3)) == ["c"]
    is_refused(bench, order(route("a", "b"), "second"), ErrorType.OTHER_ORDER)


def test_another_order_is_taken_over_after_the_end(bench: Bench) -> None:
    bench.order(order(route("a", "b")))
    bench.serve(2)
    bench.robot = replace(bench.robot, pose=Pose2(2.0, 0.0, 0.0))
    state = bench.order(order(route("b", "c", x=2.0), "second"))
    assert (state["orderId"], error_types(state), len(bench.manager.added)) == ("second", [], 2)


@pytest.mark.parametrize(
    ("x", "position", "reachable"),
    [
        (0.4, {}, True),
        (0.6, {}, False),
        (0.6, {"allowedDeviationXY": 0.7}, True),
        (0.3, {"allowedDeviationXY": 0.2}, False),
        (8.0, {"allowedDeviationXY": 10.0}, True),
    ],
)
def test_the_first_node_must_be_trivially_reachable(
    bench: Bench, x: float, position: dict[str, float], reachable: bool
) -> None:
    data = order([node("a", 0, x, **position), node("b", 2, 2.0)])
    if reachable:
        assert error_types(bench.order(data)) == []
    else:
        is_refused(bench, data, ErrorType.START_NODE, ("nodeId", "a"))


@pytest.mark.parametrize("change", [{"pose": None}, {"safety": Safety(False, ("LOCALIZATION_LOST",))}])
def test_a_robot_whose_pose_is_lost_takes_no_order(bench: Bench, change: Data) -> None:
    bench.robot = replace(bench.robot, **change)
    state = bench.tick()
    known = "localized" if bench.version is Version.V3 else "positionInitialized"
    assert state.get("agvPosition", state.get("mobileRobotPosition", {known: False}))[known] is False
    is_refused(bench, order(route("a", "b")), ErrorType.START_NODE)


@pytest.mark.parametrize(("held_by", "mode"), [(HeldBy.MANUAL, "MANUAL"), (HeldBy.STAFF, "SERVICE")])
def test_while_a_person_is_needed_the_fleet_is_not_in_control(bench: Bench, held_by: HeldBy, mode: str) -> None:
    bench.manager.held_by, bench.manager.reason = held_by, "held"
    assert bench.tick()["operatingMode"] == mode
    is_refused(bench, order(route("a", "b")), ErrorType.NOT_AVAILABLE, ("operatingMode", mode))


@pytest.mark.parametrize(("scheduled", "mode"), [(False, "SERVICE"), (True, "AUTOMATIC")])
def test_an_order_of_a_person_that_waits_comes_first(bench: Bench, scheduled: bool, mode: str) -> None:
    bench.manager.start = lambda: None  # type: ignore[method-assign]
    bench.manager.edit(Request(0, Operation.ADD, "person", (STOP,)))
    bench.manager.scheduled = {"person"} if scheduled else set()
    assert bench.tick()["operatingMode"] == mode
    if scheduled:
        assert error_types(bench.order(order(route("a", "b")))) == []
        assert bench.state["operatingMode"] == "AUTOMATIC", "its own order waits"
    else:
        is_refused(bench, order(route("a", "b")), ErrorType.NOT_AVAILABLE, ("operatingMode", mode))


def test_an_order_that_another_one_overtakes_is_cancelled(bench: Bench) -> None:
    bench.manager.start = lambda: None  # type: ignore[method-assign]
    bench.order(order(route("a", "b")))
    bench.manager.edit(Request(0, Operation.ADD, "person", (STOP,)))
    bench.manager.current = "person"
    for _ in range(3):
        bench.tick()
    assert (node_ids(bench.state), bench.manager.ended) == ([], {bench.manager.added[0]: 3})


def test_without_a_mission_manager_no_order_is_taken_over(bench: Bench) -> None:
    bench.manager.view = lambda robot: robot  # type: ignore[method-assign]
    bench.order(order(route("a", "b")))
    assert error_types(bench.state) == bench.named(ErrorType.NOT_AVAILABLE, ErrorType.MISSIONS_UNKNOWN)
    assert bench.state["operatingMode"] == "SERVICE"


# --- 5 to 8: an update -----------------------------------------------------------------------------------------------


def test_an_older_update_is_refused_and_the_order_goes_on(bench: Bench) -> None:
    bench.order(order(route("a", "b", horizon=1)))
    bench.order(order(route("a", "b"), update=3))
    is_refused(
        bench, order(route("b", "c", first=2, x=2.0), update=2), ErrorType.OUTDATED_UPDATE, ("orderUpdateId", "2")
    )
    assert node_ids(bench.serve(2)) == []
    assert bench.state["lastNodeId"] == "b"


def test_an_update_continues_the_base_and_replaces_the_horizon(bench: Bench) -> None:
    bench.order(order(route("f", "d", "g", "b", "h", horizon=2)))
    nodes = [*route("g", "x", first=4, x=4.0), node("y", 8, 8.0, released=False)]
    state = bench.order(order(nodes, update=1))
    assert [(one["nodeId"], one["released"]) for one in state["nodeStates"]] == [
        ("d", True),
        ("g", True),
        ("x", True),
        ("y", False),
    ]
    assert [one["edgeId"] for one in state["edgeStates"]] == ["f-d", "d-g", "g-x", "x-y"]
    assert len(bench.manager.added) == 1
    assert [stop.node for stop in bench.manager.orders[bench.manager.added[0]]] == [2, 4, 6]


@pytest.mark.parametrize("nodes", [route("b", "c", first=2), route("z", "c", first=4), route("c", "d", first=6)])
def test_an_update_must_begin_at_the_end_of_the_base(bench: Bench, nodes: list[Data]) -> None:
    bench.order(order(route("a", "b", "c", "d", horizon=1)))
    is_refused(bench, order(nodes, update=1), ErrorType.ORDER_UPDATE, ("orderUpdateId", "1"))


def test_the_horizon_can_be_replaced_and_deleted(bench: Bench) -> None:
    bench.order(order(route("a", "b", "c", horizon=1)))
    nodes = [node("b", 2, 2.0), node("x", 4, 3.0, released=False), node("y", 6, 4.0, released=False)]
    assert node_ids(bench.order(order(nodes, update=1))) == ["b", "x", "y"]
    assert len(bench.manager.asked) == 1
    assert node_ids(bench.order(order(route("b", first=2, x=2.0), update=2))) == ["b"]
    assert node_ids(bench.serve(2)) == []
    assert bench.kernel.record.order is not None
    assert bench.kernel.record.order.phase is Phase.COMPLETED
    assert list(bench.manager.open.values()) == [False]


@pytest.mark.parametrize("served", [0, 3])
def test_an_order_without_a_horizon_is_continued_before_and_after_its_end(bench: Bench, served: int) -> None:
    bench.order(order(route("a", "b")))
    bench.serve(served)
    bench.robot = replace(bench.robot, pose=Pose2(2.0, 0.0, 0.0))
    state = bench.order(order(route("b", "c", first=2, x=2.0), update=1))
    assert (error_types(state), state["orderUpdateId"]) == ([], 1)
    state = bench.serve(4)
    assert (state["lastNodeId"], node_ids(state), len(bench.manager.added)) == ("c", [], 2)


@pytest.mark.parametrize(("x", "taken"), [(2.0, True), (2.6, False), (200.0, False)])
def test_an_update_after_the_end_needs_the_robot_at_the_end(bench: Bench, x: float, taken: bool) -> None:
    bench.order(order(route("a", "b")))
    bench.serve(3)
    bench.robot = replace(bench.robot, pose=Pose2(x, 0.0, 0.0))
    update = order(route("b", "c", first=2, x=2.0), update=1)
    if taken:
        assert error_types(bench.order(update)) == []
    else:
        is_refused(bench, update, ErrorType.START_NODE, ("nodeId", "b"))


def test_an_update_after_the_end_in_a_held_queue_is_refused(bench: Bench) -> None:
    bench.order(order(route("a", "b")))
    bench.serve(3)
    bench.robot = replace(bench.robot, pose=Pose2(2.0, 0.0, 0.0))
    bench.manager.held_by = HeldBy.STAFF
    update = order(route("b", "c", first=2, x=2.0), update=1)
    is_refused(bench, update, ErrorType.NOT_AVAILABLE, ("operatingMode", "SERVICE"))


def test_an_update_after_an_undocking_continues_beside_its_node(bench: Bench) -> None:
    bench.robot = replace(bench.robot, loaded=True)
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, action("drop", loadId="x"))]))
    bench.robot = replace(bench.robot, pose=Pose2(1.0, 0.0, 0.0), loaded=False)  # it has backed off
    bench.serve(3)
    assert error_types(bench.order(order(route("b", "c", first=2, x=2.0), update=1))) == []


def test_the_stitching_node_keeps_its_actions(bench: Bench) -> None:
    wait = action("wait", "w1", duration=1.0)
    first = order([node("a", 0, 0.0), node("b", 2, 2.0, wait), node("c", 4, 4.0, released=False)])
    bench.order(first)
    again = [node("b", 2, 99.0, action("wait", "w2", duration=9.0)), node("c", 4, 4.0)]
    assert statuses(bench.order(order(again, update=1))) == {"w1": "WAITING"}
    stops = bench.manager.orders[bench.manager.added[0]]
    assert [(stop.x, stop.wait_s) for stop in stops] == [(2.0, 0.0), (2.0, 1.0), (4.0, 0.0)]


def test_an_action_id_is_used_once(bench: Bench) -> None:
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, action("wait", "w", duration=1.0))]))
    again = order([node("b", 2, 2.0), node("c", 4, 4.0, action("wait", "w", duration=1.0))], update=1)
    is_refused(bench, again, ErrorType.ORDER_UPDATE, ("actionId", "w"))


def test_a_cancelled_order_is_not_updated(bench: Bench) -> None:
    bench.order(order(route("a", "b", "c", horizon=1)))
    bench.instant(action("cancelOrder"))
    is_refused(bench, order(route("b", "c", first=2, x=2.0), update=1), ErrorType.UPDATE_AFTER_CANCEL)


# --- fields and actions that the robot cannot use (6.6.4.2) ----------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("maxSpeed", 0.09),
        ("maxRotationSpeed", 0.09),
        ("maxHeight", 1.0),
        ("minHeight", 0.1),
        ("orientation", 0.0),
        ("direction", "left"),
        ("rotationAllowed", False),
        ("trajectory", {"degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": [{"x": 0.0, "y": 0.0}]}),
        ("corridor", {"leftWidth": 1.0, "rightWidth": 1.0}),
        ("actions", [action("wait", duration=1.0)]),
    ],
)
def test_a_field_of_an_edge_that_cannot_be_kept_is_refused_by_name(bench: Bench, field: str, value: Any) -> None:
    data = order(route("a", "b", "c", horizon=1))
    data["edges"][1][field] = value  # of the horizon
    bench.order(data)
    kind = ErrorType.ORDER_ACTION if field == "actions" else ErrorType.UNSUPPORTED
    assert error_types(bench.state) == bench.named(kind)
    references = bench.state["errors"][0]["errorReferences"]
    shown = EDGES_V3.get(field, field) if bench.version is Version.V3 else field
    assert f"edge.{shown}" in [one["referenceKey"] for one in references]
    assert ("edgeId", "b-c") in [(one["referenceKey"], one["referenceValue"]) for one in references]


def test_fields_of_edges_that_the_robot_keeps_anyway_are_accepted(bench: Bench) -> None:
    data = order(route("a", "b"))
    data["edges"][0] |= {"maxSpeed": 20.0, "maxHeight": 2.0, "length": 2.0}
    data["edges"][0] |= {"rotationAllowed": True, "orientationType": "TANGENTIAL"}
    assert error_types(bench.order(data)) == []
    assert [stop.max_speed_mps for stop in bench.manager.orders[bench.manager.current]] == [0.0]


def test_the_speeds_of_edges_are_in_the_factsheet(bench: Bench) -> None:
    listed = {
        one["parameter"] for one in factsheet(ROBOT, bench.vehicle, PARAMS)["protocolFeatures"]["optionalParameters"]
    }
    names = {name: EDGES_V3[name] if bench.version is Version.V3 else name for name in ("maxSpeed", "maxRotationSpeed")}
    assert {f"order.edges.{name}" for name in names.values()} <= listed


def test_the_speeds_of_an_edge_hold_on_the_way_to_its_node(bench: Bench) -> None:
    stop = action("wait", "w", duration=1.0)
    data = order([node("a", 0, 0.0), node("b", 2, 2.0, stop), node("c", 4, 4.0), node("d", 6, 6.0, released=False)])
    data["edges"][0] |= {"maxSpeed": 0.5, "maxRotationSpeed": 0.2}
    data["edges"][2] |= {"maxSpeed": 0.3}
    bench.order(data)
    again = order([node("c", 4, 4.0), node("d", 6, 6.0)], update=1)
    again["edges"][0] |= {"maxSpeed": 0.4}
    bench.order(again)
    given = bench.manager.orders[bench.manager.current]
    limits = [(stop.action, stop.max_speed_mps, stop.max_yaw_rate_radps) for stop in given]
    assert limits == [("", 0.5, 0.2), ("w", 0.5, 0.2), ("", 0.0, 0.0), ("", 0.4, 0.0)]


@pytest.mark.parametrize(
    ("change", "field", "kind"),
    [
        (lambda one: one.pop("nodePosition"), "nodePosition", ErrorType.UNSUPPORTED),
        (lambda one: one["nodePosition"].update(mapId="moon"), "nodePosition.mapId", ErrorType.UNKNOWN_MAP),
        (lambda one: one["nodePosition"].update(x=1e9), "nodePosition", ErrorType.NO_ROUTE),
        (
            lambda one: one.update(actions=[action("wait", f"w{i}", duration=0.0) for i in range(9)]),
            "actions",
            ErrorType.MEMORY,
        ),
    ],
)
def test_what_a_node_asks_and_the_robot_has_not_is_refused_by_name(
    bench: Bench, change: Callable[[Data], Any], field: str, kind: ErrorType
) -> None:
    data = order(route("a", "b", "c", horizon=1))
    change(data["nodes"][2])
    is_refused(bench, data, kind, ("nodeId", "c"), ("field", field))


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        (action("lift"), "actionType"),
        (action("finePositioning"), "actionType"),
        (action("stopCharging"), "actionType"),
        (action("wait"), "duration"),
        (action("wait", duration="long"), "duration"),
        (action("wait", duration=1e6), "duration"),
        (action("pick"), "stationName"),
        (action("pick", stationName="nowhere"), "stationName"),
        (action("pick", stationName="charger"), "stationName"),
        (action("pick", stationName=["chair_1"]), "stationName"),
        (action("pick", stationName="chair_1", loadType="EPAL"), "loadType"),
        (action("pick", stationName="chair_1", lhd="rear"), "lhd"),
        (action("pick", stationName="chair_1", height=1.0), "height"),
    ],
)
def test_an_action_that_the_robot_has_not_is_refused_by_name(bench: Bench, wrong: Data, field: str) -> None:
    data = order(route("a", "b", "c", horizon=1))
    data["nodes"][2]["actions"] = [wrong]
    is_refused(bench, data, ErrorType.ORDER_ACTION, ("nodeId", "c"), ("field", field))


@pytest.mark.parametrize("field", ["allowedDeviationXY", "allowedDeviationTheta"])
def test_deviations_below_the_robots_own_are_refused(field: str) -> None:
    """From 3.0 on they ask for what the robot can do."""
    nodes = [node("a", 0, 0.0), node("b", 2, 2.0, theta=0.0, **{field: 0.001})]
    is_refused(Bench(), order(nodes), ErrorType.UNSUPPORTED, ("nodeId", "b"), ("field", field))


def test_zones_are_refused() -> None:
    """From 3.0 on they belong to maps, not to orders."""
    is_refused(Bench(), order(route("a", "b"), zoneSetId="z"), ErrorType.UNSUPPORTED, ("zoneSetId", "z"))


def test_too_many_nodes_are_refused(bench: Bench) -> None:
    is_refused(bench, order(route(*(f"n{i}" for i in range(255)))), ErrorType.MEMORY, ("nodes", "255"))
    assert error_types(bench.order(order(route(*(f"n{i}" for i in range(254)))))) == []


@pytest.mark.parametrize(
    ("actions", "loaded"),
    [
        ([action("drop")], False),
        ([action("pick", "p1", stationName="chair_1"), action("pick", "p2", stationName="chair_1")], False),
        ([action("pick", stationName="chair_1")], True),
    ],
)
def test_loads_must_be_possible(bench: Bench, actions: list[Data], loaded: bool) -> None:
    bench.robot = replace(bench.robot, loaded=loaded)
    is_refused(bench, order([node("a", 0, 0.0), node("b", 2, 2.0, *actions)]), ErrorType.ORDER_ACTION)


def test_loads_are_followed_over_updates(bench: Bench) -> None:
    pick = action("pick", stationName="chair_1")
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, pick), node("c", 4, 4.0, released=False)]))
    again = order([node("b", 2, 2.0), node("c", 4, 4.0, pick | {"actionId": "p2"})], update=1)
    is_refused(bench, again, ErrorType.ORDER_ACTION, ("actionId", "p2"))
    assert error_types(bench.order(order([node("b", 2, 2.0), node("c", 4, 4.0, action("drop"))], update=1))) == []


# --- the base as waypoints -------------------------------------------------------------------------------------------


def test_the_base_becomes_waypoints(bench: Bench) -> None:
    nodes = [
        node("a", 0, 0.0),
        node("b", 2, 2.0, y=2.0),
        node("c", 4, 2.0, action("pick", stationName="chair_1", loadType="wheelchair"), y=4.0, theta=3.0),
        node("d", 6, 2.0, action("wait", duration=4.0), action("drop"), y=6.0),
        node("e", 8, 2.0, y=8.0),
    ]
    bench.order(order(nodes))
    stops = bench.manager.orders[bench.manager.added[0]]
    assert [(stop.node, stop.action, stop.kind, stop.wait_s, stop.dock_id) for stop in stops] == [
        (2, "", Kind.PASS, 0.0, ""),
        (4, "", Kind.WAIT, 0.0, ""),
        (4, "pick", Kind.DOCK, 0.0, "chair_1"),
        (6, "", Kind.WAIT, 0.0, ""),
        (6, "wait", Kind.WAIT, 4.0, ""),
        (6, "drop", Kind.UNDOCK, 0.0, ""),
        (8, "", Kind.PARK, 0.0, ""),
    ]
    # Without theta the robot faces the direction of travel.
    assert [round(stop.yaw, 3) for stop in stops] == [0.785, 3.0, 3.0, 1.571, 1.571, 1.571, 1.571]
    names = [stop.name for stop in stops]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("position", "kind"),
    [
        ({}, Kind.PASS),
        ({"allowedDeviationXY": 0.5}, Kind.PASS),
        ({"allowedDeviationXY": 0.4}, Kind.WAIT),
        ({"theta": 0.0, "allowedDeviationTheta": 0.6}, Kind.PASS),
        ({"theta": 0.0, "allowedDeviationTheta": 0.1}, Kind.WAIT),
    ],
)
def test_a_node_with_a_small_deviation_is_stopped_at(bench: Bench, position: dict[str, float], kind: Kind) -> None:
    bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, **position), node("c", 4, 4.0)]))
    assert bench.manager.orders[bench.manager.added[0]][0].kind is kind


def test_a_node_may_come_again(bench: Bench) -> None:
    bench.order(order(route("a", "b", "a", "b", "a")))
    assert node_ids(bench.serve(2)) == ["b", "a"]
    assert node_ids(bench.serve(3)) == []
    assert bench.state["lastNodeSequenceId"] == 8


def test_names_for_the_screen_are_printable_and_short(bench: Bench) -> None:
    bench.order(order(route("a", "x\n\t" * 40, "y ")))
    names = [stop.name for stop in bench.manager.orders[bench.manager.added[0]]]
    assert all(name.isprintable() and 0 < len(name) <= 64 and name == name.strip() for name in names)


def test_an_order_of_one_node_is_done_at_once(bench: Bench) -> None:
    state = bench.order(order(route("a")))
    assert (state["lastNodeId"], node_ids(state), bench.manager.added) == ("a", [], [])
    assert bench.kernel.record.order is not None
    assert bench.kernel.record.order.phase is Phase.COMPLETED


def test_a_long_order_is_continued_beyond_what_one_mission_holds() -> None:
    bench, count = Bench(), 254
    for update in (0, 1, 2):
        names = [f"n{(count - 1) * update + i}" for i in range(count)]
        bench.order(order(route(*names, first=2 * (count - 1) * update), update=update))
        assert error_types(bench.state) == []
    for _ in range(40):  # each state of that many nodes takes a while
        for _ in range(25):
            bench.manager.serve()
        bench.tick()
    assert (node_ids(bench.state), bench.state["lastNodeId"]) == ([], f"n{3 * (count - 1)}")
    assert sum(map(len, bench.manager.orders.values())) == 3 * (count - 1)
    assert all(len(stops) <= 254 for stops in bench.manager.orders.values())


def test_tolerances_are_those_of_the_mission_manager() -> None:

    manager = read_yaml(config_dir() / "mission_manager.yaml")
    assert (VEHICLE.pass_m, VEHICLE.pass_rad) == (
        manager["pass_position_tolerance_m"],
        manager["pass_yaw_tolerance_rad"],
    )
    assert (VEHICLE.stand_m, VEHICLE.stand_rad) == (manager["position_tolerance_m"], manager["yaw_tolerance_rad"])
    assert read_yaml(config_dir() / "ndt_localization.yaml")["map"] == VEHICLE.map_id


def test_the_orders_of_the_documentation_are_carried_out(bench: Bench) -> None:
    text = (config_dir().parent / "docs/fleet.md").read_text(encoding="utf-8")
    first, second = (json.loads(block) for block in re.findall(r"```json\n(.*?)```", text, re.DOTALL))
    bench.robot = replace(bench.robot, pose=Pose2(-0.3, 8.8, 0.0))
    assert error_types(bench.order(first)) == []
    bench.serve(3)
    assert error_types(bench.order(second)) == []
    assert node_ids(bench.serve(5)) == []
    assert statuses(bench.state) == {"pick_17": "FINISHED", "drop_17": "FINISHED"}


@pytest.mark.parametrize("file", sorted(config_dir().glob("fleet/*.json")), ids=lambda file: file.stem)
def test_the_example_orders_are_accepted_at_the_origin(file: Path) -> None:
    bench = Bench()
    data = HEADER | {"orderId": file.stem, "orderUpdateId": 0} | json.loads(file.read_text(encoding="utf-8"))
    state = bench.order(data)
    assert (state["orderId"], error_types(state)) == (file.stem, [])
    assert bench.serve(20)["lastNodeId"] == data["nodes"][-1]["nodeId"]
