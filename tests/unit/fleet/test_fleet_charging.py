"""startCharging docks to a charger at the end of an order, and stopCharging leaves it (2.1.0, 6.8.1; 3.0.0, 6.2.1)."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Kind
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.link import Topic
from robot_stack.fleet.record import Phase
from robot_stack.fleet.version import Version
from tests.benchmarks.support.dispatcher import Rules
from tests.benchmarks.support.fleet_yard import YardFleet, yard
from tests.unit.fleet.master import HEADER, ROBOT, Bench, Data, action, error_types, node, order, route, statuses

START = action("startCharging", "start")
STOP = action("stopCharging", "stop")


@pytest.fixture(params=list(Version))
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


def to_charger(*actions: Data, **changed: str) -> Data:
    return order([node("a", 0, 0.0), node("b", 2, 2.0), node("charger", 4, 4.0, *(actions or (START,)))], **changed)


@pytest.fixture
def docked(bench: Bench) -> Bench:
    bench.order(to_charger())
    bench.serve(3)
    return bench


def kinds(bench: Bench) -> list[Kind]:
    return [stop.kind for stop in bench.manager.orders[bench.manager.added[0]]]


def test_the_order_ends_at_the_charger_and_the_mission_stays_open(docked: Bench) -> None:
    state = docked.state
    assert (statuses(state), state["nodeStates"]) == ({"start": "FINISHED"}, [])
    assert state["operatingMode"] == "AUTOMATIC"
    assert kinds(docked)[-1] is Kind.DOCK
    assert docked.manager.orders[docked.manager.added[0]][-1].dock_id == "charger"
    assert docked.manager.open[docked.manager.added[0]]


def test_stop_charging_leaves_the_charger_back_to_its_node(docked: Bench) -> None:
    state = docked.instant(STOP)
    assert statuses(state)["stop"] == "RUNNING"
    state = docked.serve(2)
    assert statuses(state)["stop"] == "FINISHED"
    assert kinds(docked)[-2:] == [Kind.UNDOCK, Kind.PARK]
    assert docked.kernel.record.order is not None
    assert docked.kernel.record.order.phase is Phase.COMPLETED
    docked.robot = replace(docked.robot, pose=replace(docked.robot.pose, x=4.0))
    state = docked.order(order([node("charger", 0, 4.0), node("b", 2, 2.0)], "next"))
    assert (state["orderId"], error_types(state)) == ("next", [])


def test_at_the_charger_no_other_order_update_or_cancellation_is_accepted(docked: Bench) -> None:
    state = docked.order(order(route("a", "b"), "other"))
    assert error_types(state) == docked.named(ErrorType.OTHER_ORDER)
    assert "stopCharging" in state["errors"][0]["errorDescription"]
    state = docked.order(order([node("charger", 4, 4.0), node("b", 6, 2.0)], update=1))
    assert error_types(state)[-1:] == docked.named(ErrorType.ORDER_UPDATE)
    state = docked.instant(action("cancelOrder", "cancel"))
    assert statuses(state)["cancel"] == "FAILED"
    assert docked.manager.current


def test_an_update_waits_until_the_robot_has_left_the_charger(docked: Bench) -> None:
    docked.instant(STOP)
    update = order([node("charger", 4, 4.0), node("b", 6, 2.0)], update=1)
    assert error_types(docked.order(update)) == docked.named(ErrorType.ORDER_UPDATE)
    assert "leaves the charger" in docked.state["errors"][0]["errorDescription"]
    docked.serve()  # undocked, and on the way back
    assert error_types(docked.order(update)) == docked.named(ErrorType.ORDER_UPDATE)
    docked.serve()
    docked.robot = replace(docked.robot, pose=Pose2(4.0, 0.0, 0.0))
    assert error_types(docked.order(update)) == []
    assert statuses(docked.state)["stop"] == "FINISHED"
    assert docked.serve(2)["lastNodeId"] == "b"


def test_stop_charging_ends_before_another_order_takes_the_place_of_its_own(docked: Bench) -> None:
    docked.instant(STOP)
    docked.manager.serve()
    docked.manager.serve()
    docked.robot = replace(docked.robot, pose=replace(docked.robot.pose, x=4.0))
    docked.receive(order([node("charger", 0, 4.0), node("b", 2, 2.0)], "next"))
    docked.tick()
    state = docked.tick()
    assert state["orderId"] == "next"
    assert statuses(state).get("stop", "FINISHED") == "FINISHED"


def test_cancelling_on_the_way_out_stops_the_robot_and_fails_stop_charging(docked: Bench) -> None:
    docked.instant(STOP)
    docked.instant(action("cancelOrder", "cancel"))
    found = statuses(docked.tick())
    assert (found["stop"], found["cancel"]) == ("FAILED", "FINISHED")


@pytest.mark.parametrize(("count", "updated"), [(253, False), (254, False), (254, True)])
def test_the_way_out_of_the_charger_belongs_to_the_part_that_leads_in(bench: Bench, count: int, updated: bool) -> None:
    """count: waypoints of the base, with the docking."""
    nodes = [node(f"n{i}", 2 * i, 0.1 * i) for i in range(count)]
    nodes[-1]["actions"] = [START]
    split = 200 if updated else 0
    if updated:
        ahead = [entry | {"released": i < split} for i, entry in enumerate(nodes[: split + 1])]
        bench.order(order(ahead))
        bench.order(order(nodes[split - 1 :], update=1))
    else:
        bench.order(order(nodes))
    for _ in range(3):  # parts
        for _ in range(count):
            bench.manager.serve()
        bench.tick()
        bench.tick()
    assert statuses(bench.state) == {"start": "FINISHED"}
    assert bench.manager.current, "the order stays open"
    bench.instant(STOP)
    last = bench.manager.orders[bench.manager.added[-1]]
    assert [stop.kind for stop in last[-3:]] == [Kind.DOCK, Kind.UNDOCK, Kind.PARK]
    assert all(len(stops) <= 254 for stops in bench.manager.orders.values())
    assert statuses(bench.serve(2))["stop"] == "FINISHED"


def test_stop_charging_needs_a_robot_that_charges_by_an_order(bench: Bench) -> None:
    assert statuses(bench.instant(STOP))["stop"] == "FAILED"
    bench.order(to_charger())
    bench.serve(2)
    state = bench.instant(action("stopCharging", "early"))
    assert statuses(state) == {"start": "RUNNING", "early": "FAILED"} | (
        {"stop": "FAILED"} if bench.version is Version.V3 else {}
    )
    assert kinds(bench)[-1] is Kind.DOCK


def test_an_undocking_that_fails_fails_the_action(docked: Bench) -> None:
    docked.instant(STOP)
    docked.manager.fail()
    assert statuses(docked.tick())["stop"] == "FAILED"


@pytest.mark.parametrize("death", [0, 1, 2])
def test_a_restarted_agent_goes_on_with_the_charging(docked: Bench, death: int) -> None:
    docked.restart()
    docked.kernel.receive(Topic.INSTANT_ACTIONS, _instant(docked))
    for tick in range(5):
        docked.tick()
        if tick == death:
            docked.restart()
    docked.serve(2)
    docked.kernel.connected()
    assert statuses(docked.tick())["stop"] == "FINISHED"
    assert kinds(docked).count(Kind.UNDOCK) == 1


def _instant(bench: Bench) -> bytes:
    stop = STOP | {"blockingType": "NONE"}
    return json.dumps(HEADER | {"version": bench.version.value, "actions": [stop]}).encode()


@pytest.mark.parametrize(
    ("actions", "field"),
    [
        ((action("startCharging", stationName="chair_1"),), "stationName"),
        ((action("startCharging", stationName=3),), "stationName"),
        ((action("startCharging", current=3),), "current"),
        ((START, action("wait", duration=1.0)), ""),
        ((action("pick", stationName="chair_1"), START), ""),
    ],
)
def test_what_is_wrong_is_refused_by_name(bench: Bench, actions: tuple[Data, ...], field: str) -> None:
    state = bench.order(to_charger(*actions))
    (error,) = state["errors"]
    assert error_types(state) == bench.named(ErrorType.ORDER_ACTION)
    named = {one["referenceKey"]: one["referenceValue"] for one in error["errorReferences"]}
    assert named.get("field", "") == field
    assert "actionId" in named
    assert bench.manager.added == []


def test_an_order_that_goes_on_after_the_charger_is_refused(bench: Bench) -> None:
    state = bench.order(order([node("charger", 0, 0.0, START), node("b", 2, 2.0, released=False)]))
    assert "stopCharging follows" in state["errors"][0]["errorDescription"]


def test_without_a_charger_both_are_refused_and_not_in_the_factsheet(bench: Bench) -> None:
    bench.vehicle = replace(bench.vehicle, docks={"chair_1": "wheelchair"})
    bench.restart()
    state = bench.order(to_charger())
    assert "the site has no charger" in state["errors"][0]["errorDescription"]
    assert statuses(bench.instant(STOP)) == {"stop": "FAILED"}
    for docks, listed in (({}, set()), ({"c": "charger"}, {"startCharging", "stopCharging"})):
        data = factsheet(ROBOT, replace(bench.vehicle, docks=docks), bench.kernel._params)
        actions = {one["actionType"] for one in data["protocolFeatures"]["agvActions"]}
        assert actions & {"startCharging", "stopCharging"} == listed


def test_of_several_chargers_the_action_names_one(bench: Bench) -> None:
    bench.vehicle = replace(bench.vehicle, docks={"east": "charger", "west": "charger"})
    bench.restart()
    assert "known: east, west" in bench.order(to_charger())["errors"][0]["errorDescription"]
    bench.order(to_charger(action("startCharging", stationName="west")))
    assert bench.manager.orders[bench.manager.added[0]][-1].dock_id == "west"


def test_the_dispatcher_sends_robots_with_a_low_battery_to_the_charger() -> None:
    fleet = YardFleet(yard(3, 2, chargers=1), rules=Rules(low=50.0, full=60.0), charge=0.5)
    fleet.give(2)
    fleet.finish(2400.0)
    assert all(vehicle.charge > 0.5 for vehicle in fleet.vehicles.values())
