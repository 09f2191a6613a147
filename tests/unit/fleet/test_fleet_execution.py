"""States of an order under way: nodes, edges, actions, and how it ends."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot_stack.contract.states import HeldBy, MissionState
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.fleet.errors import ErrorType, name_of
from robot_stack.fleet.progress import Operation, Request
from robot_stack.fleet.record import NOT_SENT, Phase
from robot_stack.fleet.robot import Battery, Safety
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import PARAMS, Bench, Data, action, error_types, node, node_ids, order, route, statuses


@pytest.fixture(params=list(Version))
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


def transport() -> list[Data]:
    return [
        node("a", 0, 0.0),
        node("b", 2, 2.0, action("pick", stationName="chair_1", loadId="chair 7")),
        node("c", 4, 4.0),
        node("d", 6, 6.0, action("wait", duration=1.0), action("drop")),
    ]


def test_actions_wait_run_and_finish_in_their_sequence(bench: Bench) -> None:
    states = [bench.order(order(transport())), *(bench.serve() for _ in range(6))]
    waiting, running, finished = "WAITING", "RUNNING", "FINISHED"
    assert [(state["lastNodeId"], *statuses(state).values()) for state in states] == [
        ("a", waiting, waiting, waiting),
        ("b", running, waiting, waiting),  # a node is traversed before its actions begin
        ("b", finished, waiting, waiting),
        ("c", finished, waiting, waiting),
        ("d", finished, running, waiting),
        ("d", finished, finished, running),
        ("d", finished, finished, finished),
    ]
    assert [len(state["edgeStates"]) for state in states] == [3, 2, 2, 1, 0, 0, 0]
    assert bench.kernel.record.order is not None
    assert bench.kernel.record.order.phase is Phase.COMPLETED


def test_a_paused_action_is_reported_as_paused(bench: Bench) -> None:
    bench.order(order(transport()))
    bench.serve()
    bench.manager.state = MissionState.PAUSED
    assert statuses(bench.serve())["pick"] == "PAUSED"
    assert bench.state["paused"]
    bench.manager.state = MissionState.RUNNING
    assert statuses(bench.tick())["pick"] == "RUNNING"


def test_the_load_is_reported_with_its_id(bench: Bench) -> None:
    bench.order(order(transport()))
    bench.serve(2)
    assert bench.state["loads"] == []
    bench.robot = replace(bench.robot, loaded=True)
    bench.tick()
    assert bench.state["loads"] == [{"loadId": "chair 7", "loadType": "wheelchair", "loadPosition": "front"}]


@pytest.mark.parametrize(("state", "word"), [(3, "ABORTED"), (4, "FAILED"), (5, "REMOVED")])
def test_an_order_that_the_robot_cannot_finish_is_aborted(bench: Bench, state: int, word: str) -> None:
    bench.order(order(transport()))
    bench.serve()
    bench.manager.fail(state)
    bench.tick()
    assert bench.named(ErrorType.ORDER_ABORTED)[0] in error_types(bench.state), word
    # The queue is not held: from 3.0 on the level says that the robot takes another order.
    assert bench.state["errors"][0]["errorLevel"] == ("CRITICAL" if bench.version is Version.V3 else "FATAL")
    assert set(statuses(bench.state).values()) == {"FAILED"}
    assert (bench.state["nodeStates"], bench.state["edgeStates"], bench.state["orderId"]) == ([], [], "order_1")
    bench.robot = replace(bench.robot, pose=Pose2(2.0, 0.0, 0.0))
    assert error_types(bench.order(order([node("b", 0, 2.0)], "second"))) == []


@pytest.mark.parametrize("refuses", [False, True])
def test_an_order_that_the_mission_manager_forgets_or_refuses_is_aborted(bench: Bench, refuses: bool) -> None:
    if refuses:
        bench.manager.edit = lambda request: (False, "the queue is full")  # type: ignore[method-assign]
    bench.order(order(transport()))
    if not refuses:
        bench.serve()
        bench.manager.added.clear()
        bench.manager.current = ""
        bench.tick()
    assert error_types(bench.tick()) == bench.named(ErrorType.ORDER_ABORTED)
    assert not refuses or "the queue is full" in bench.state["errors"][0]["errorDescription"]


def test_a_request_without_an_answer_is_repeated_and_has_its_effect_once(bench: Bench) -> None:
    bench.silent = True
    bench.order(order(route("a", "b", "c", horizon=1)))
    for _ in range(10):
        bench.tick()
    assert bench.manager.orders == {}
    bench.silent = False
    bench.order(order(route("b", "c", first=2, x=2.0), update=1))
    bench.serve(5)
    assert (bench.state["lastNodeId"], len(bench.manager.added)) == ("c", 1)


def test_a_late_answer_to_another_request_does_not_count(bench: Bench) -> None:
    bench.silent = True
    bench.order(order(route("a", "b")))
    record = bench.kernel.record.order
    assert record is not None
    assert record.part is not None
    bench.kernel.answered(Request(99, Operation.ADD, record.part.id), True, "late")
    assert bench.kernel.record.order == record
    assert record.part.acknowledged == NOT_SENT


@pytest.mark.parametrize("restarts", [False, True])
@pytest.mark.parametrize("lost", ["add", "extend"])
def test_what_follows_a_lost_answer_does_not_change_the_request(bench: Bench, lost: str, restarts: bool) -> None:
    """The mission manager has taken the request, and refuses it with other contents."""
    if lost == "extend":
        bench.order(order(route("a", "b", "c", horizon=1)))
    first = order(route("a", "b", "c", "d", horizon=1))
    second = order(route("b", "c", "d", first=2, x=2.0, horizon=1), update=1)
    bench.receive(second if lost == "extend" else first)
    bench.compute()
    bench.save()
    bench.perform(answer=False)
    if restarts:
        bench.restart()
    third = order(route("c", "d", "e", first=4, x=4.0), update=2)
    state = bench.order(third)
    for _ in range(8):
        state = bench.tick()
    assert error_types(state) == []
    assert (node_ids(bench.serve(6)), bench.state["lastNodeId"], len(bench.manager.added)) == ([], "e", 1)


@pytest.mark.parametrize("update", [0, 1])
def test_a_route_that_was_completed_without_an_answer_is_not_driven_again(bench: Bench, update: int) -> None:
    """Meanwhile another client's mission is shown."""
    if update:
        bench.order(order(route("a", "b", "c", horizon=1)))
    last = order(route("b", "c", first=2, x=2.0), update=1) if update else order(route("a", "b", "c"))
    bench.receive(last)
    bench.compute()
    bench.save()
    bench.perform(answer=False)
    for _ in range(3):
        bench.manager.serve()
    bench.manager.orders["tour"], bench.manager.open["tour"] = [], True
    bench.manager.added.append("tour")
    bench.manager.start()
    bench.restart()
    bench.tick()
    bench.tick()
    assert (node_ids(bench.state), bench.state["lastNodeSequenceId"], error_types(bench.state)) == ([], 4, [])
    assert len(bench.manager.added) == 2


@pytest.mark.parametrize("for_good", [False, True])
def test_an_extension_that_is_refused_is_repeated_until_it_is_taken_or_cancelled(bench: Bench, for_good: bool) -> None:
    bench.order(order(route("a", "b", "c", horizon=1)))
    extend = bench.manager._extend
    bench.manager._extend = lambda request: (False, "in the zone 'pond'")  # type: ignore[method-assign]
    bench.order(order(route("b", "c", first=2, x=2.0), update=1))
    for _ in range(10 if for_good else 1):
        bench.tick()
    assert error_types(bench.state) == bench.named(ErrorType.ORDER_UPDATE)
    assert "in the zone 'pond'" in bench.state["errors"][0]["errorDescription"]
    if for_good:
        bench.instant(action("cancelOrder", "cancel"))
        assert statuses(bench.tick())["cancel"] == "FINISHED"
    else:
        bench.manager._extend = extend  # type: ignore[method-assign]
        for _ in range(3):
            bench.tick()
        assert node_ids(bench.serve(3)) == []
        assert len(bench.manager.added) == 1
    assert bench.state["errors"] == []


def test_an_update_that_comes_with_the_end_of_the_route_becomes_the_next_order(bench: Bench) -> None:
    bench.order(order(route("a", "b", "c", horizon=1)))
    bench.order(order(route("b", first=2, x=2.0), update=1))  # the horizon is gone: the route is complete
    bench.manager.serve()
    bench.robot = replace(bench.robot, pose=Pose2(2.0, 0.0, 0.0))
    bench.order(order(route("b", "c", first=2, x=2.0), update=2))
    assert (node_ids(bench.serve(3)), len(bench.manager.added)) == ([], 2)


def test_driving_by_hand_clears_the_order(bench: Bench) -> None:
    bench.manager.held_by = HeldBy.NOTHING
    bench.order(order(transport()))
    bench.manager.held_by = HeldBy.MANUAL
    for _ in range(3):
        bench.tick()
    assert bench.state["operatingMode"] == "MANUAL"
    assert (bench.state["nodeStates"], set(statuses(bench.state).values())) == ([], {"FAILED"})
    assert [request.operation for request in bench.manager.asked][-1] is Operation.CANCEL


@pytest.mark.parametrize("horizon", [1, 0])
def test_a_new_base_is_requested_before_the_robot_brakes(bench: Bench, horizon: int) -> None:
    bench.order(order(route("a", "b", "c", "d", "e", horizon=horizon)))
    assert not bench.state["newBaseRequest"]  # 6 m ahead
    bench.robot = replace(bench.robot, pose=Pose2(1.5, 0.0, 0.0))
    assert bench.serve()["newBaseRequest"] is (horizon > 0), "a complete order needs none"
    assert PARAMS.base_request_m == 5.0


# --- when a state is sent (6.10) -------------------------------------------------------------------------------------


def test_the_state_names_the_map_that_is_in_force(bench: Bench) -> None:
    assert bench.tick()["maps"] == [{"mapId": "yard", "mapVersion": "1", "mapStatus": "ENABLED"}]


def test_a_state_is_sent_at_least_in_its_period(bench: Bench) -> None:
    bench.tick()
    before = len(bench.states)
    for _ in range(60):
        bench.tick()
    assert len(bench.states) - before == 60 // PARAMS.state_period_s


@pytest.mark.parametrize(
    ("change", "sent"),
    [
        ({"loaded": True}, True),
        ({"twist": Twist2(0.5, 0.0, 0.0)}, True),
        ({"twist": Twist2(0.0, 0.0, 0.5)}, True),
        ({"safety": Safety(False, ("LIDAR_TIMEOUT",))}, True),
        ({"battery": Battery(80.0, 50.0, True)}, True),
        ({"battery": None}, True),
        ({"pose": Pose2(0.1, 0.0, 0.0), "battery": Battery(79.9, 49.9, False), "quality": 0.8}, False),
    ],
)
def test_an_event_is_sent_at_once_and_what_always_changes_is_none(bench: Bench, change: Data, sent: bool) -> None:
    bench.tick()
    before = len(bench.states)
    bench.tick()
    assert len(bench.states) == before
    bench.robot = replace(bench.robot, **change)
    bench.tick()
    assert len(bench.states) == before + sent


def test_states_are_not_sent_faster_than_permitted(bench: Bench) -> None:
    for index in range(100):
        bench.robot = replace(bench.robot, loaded=bool(index % 2))
        bench.now_s += 0.01 - 1.0  # a tick of 10 ms
        bench.tick()
    assert len(bench.states) <= 1 + 1.0 / PARAMS.state_min_interval_s


def test_state_and_factsheet_are_sent_at_a_connection(bench: Bench) -> None:
    bench.tick()
    bench.sent.clear()
    bench.kernel.connected()
    bench.tick()
    assert {topic.value for topic, _ in bench.sent} >= {"state", "factsheet"}


# --- safety ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("safety", "stop", "violated", "errors"),
    [
        (Safety(False, ()), "NONE", False, []),
        (Safety(True, ("ESTOP_PRESSED",)), "MANUAL", False, [("ESTOP_PRESSED", "FATAL")]),
        (Safety(False, ("COLLISION_IMMINENT",)), "AUTOACK", True, [("COLLISION_IMMINENT", "WARNING")]),
        (Safety(True, ("CONTACT",)), "MANUAL", True, [("CONTACT", "FATAL")]),
        (Safety(False, ("BATTERY_LOW",)), "NONE", False, [("BATTERY_LOW", "WARNING")]),
        (Safety(False, ("NEW_CODE",)), "NONE", False, [("NEW_CODE", "FATAL")]),
        (None, "MANUAL", False, [(ErrorType.SAFETY_UNKNOWN, "FATAL")]),
    ],
)
def test_safety_is_reported(
    bench: Bench, safety: Safety | None, stop: str, violated: bool, errors: list[tuple[str, str]]
) -> None:
    bench.robot = replace(bench.robot, safety=safety)
    state = bench.tick()
    key = "eStop"
    if bench.version is Version.V3:
        key, stop = "activeEmergencyStop", "NONE" if stop == "AUTOACK" else stop
    assert state["safetyState"] == {key: stop, "fieldViolation": violated}
    expected = [(name_of(kind, bench.version), level) for kind, level in errors]
    assert [(one["errorType"], one["errorLevel"]) for one in state["errors"]] == expected


def test_an_unknown_battery_is_an_error(bench: Bench) -> None:
    bench.robot = replace(bench.robot, battery=Battery(float("nan"), float("nan"), False))
    assert error_types(bench.tick()) == bench.named(ErrorType.BATTERY_UNKNOWN)
    if bench.version is Version.V3:
        assert bench.state["powerSupply"] == {"stateOfCharge": 0.0, "charging": False}
    else:
        assert bench.state["batteryState"] == {"batteryCharge": 0.0, "charging": False}


def test_a_mission_of_another_client_takes_the_control_and_a_hold_does_not_during_an_order(bench: Bench) -> None:
    bench.order(order(transport()))
    bench.manager.held_by = HeldBy.STAFF
    assert bench.serve()["operatingMode"] == "AUTOMATIC"
    other = Bench(bench.version)
    other.manager.orders["tour"], other.manager.open["tour"] = [], True
    other.manager.added.append("tour")
    other.manager.start()
    assert other.tick()["operatingMode"] == "SERVICE"
