"""Orders that bring their route: it is extended while the robot drives, paused, resumed and cancelled by its giver."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robot_stack.contract.states import HeldBy
from robot_stack.core.mission import MAX_WAYPOINTS
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation, OrderState, Origin
from robot_stack.mission.states import UNDER_WAY, State

from .conftest import DockStory, Story, make_mission, waypoints_of

DOCK = {"dock": "chair_1"}
CRITICAL = ("BATTERY_LOW", "BATTERY_CRITICAL")
AWAITS = "waiting for the next part of the route from the fleet"
Act = Callable[[Story], object]


def current(story: Story) -> str | None:
    order = story.kernel.record.queue.current
    return order.id if order else None


def state_of(story: Story, order_id: str = "a") -> OrderState:
    order = story.kernel.record.queue.known(order_id)
    assert order is not None
    return order.state


def held(story: Story) -> HeldBy:
    return story.queues[-1].held_by


def route_of(story: Story) -> list[str]:
    record = story.kernel.record
    mission = record.mission if record.queue.current else record.queue.orders[0].mission
    return [waypoint.name for waypoint in mission.waypoints]


def refused(story: Story, why: str, act: Act) -> None:
    """``act`` is refused because of ``why``, and has changed nothing."""
    before, saved, goal = story.kernel.record, len(story.journal.records), story.goal
    act(story)
    assert not story.answer.success
    assert why in story.answer.message
    assert (story.kernel.record, story.goal) == (before, goal)
    assert len(story.journal.records) == saved


def undone(story: Story, act: Act) -> None:
    """``act`` cannot be journaled: it is refused, and has changed nothing."""
    before, queue = story.kernel.record, story.queues[-1]
    story.journal.problem = "full"
    act(story)
    story.journal.problem = ""
    assert not story.answer.success
    assert "full" in story.answer.message
    assert story.kernel.record == before
    assert story.queues[-1] == queue


def at_end(story: Story) -> Story:
    """At the present end of an open route of two waypoints."""
    story.brings("pass", "pass").reach(2.0).reach(4.0)
    assert (story.state, story.status.reason) == (State.WAITING, AWAITS)
    return story


# --- the order -------------------------------------------------------------------------------------------------------


def bad(**changes) -> list[dict]:
    return [*waypoints_of("pass"), {**waypoints_of("pass", "park")[1], **changes}]


@pytest.mark.parametrize(
    ("waypoints", "mission_id", "why"),
    [
        (bad(x=float("nan")), "tour", "waypoint 2 'w1': x: Input should be a finite number (is nan)"),
        (bad(yaw=90.0), "tour", "waypoint 2 'w1': yaw: Input should be less than or equal to 6.2832 (is 90.0)"),
        (
            bad(max_speed_mps=0.05),
            "tour",
            "waypoint 2 'w1': max_speed_mps: Input should be greater than or equal to 0.1",
        ),
        (bad(max_yaw_rate_radps=float("nan")), "tour", "waypoint 2 'w1': max_yaw_rate_radps: Input should be"),
        (bad(name=""), "tour", "waypoint 2 '': name: String should have at least 1 character (is '')"),
        (bad(name="x" * 999), "tour", "name: String should have at most 64 characters"),
        (bad(name="w0"), "tour", "waypoints: every waypoint needs a unique name: w0 is used more than once"),
        (bad(action="fly"), "tour", "waypoint 2 'w1': action: must be pass, park, undock"),
        (bad(action={"wait": -1.0}), "tour", "waypoint 2 'w1': action.wait_s: Input should be greater"),
        (bad(action={"dock": ""}), "tour", "waypoint 2 'w1': action: must be pass"),
        (bad(), "../tour", "id: String should match pattern"),
        (bad(), "", "id: String should match pattern"),
        (bad(action={"dock": "nowhere"}), "tour", "waypoint 'w1' of 'tour': there is no dock 'nowhere'"),
        (waypoints_of(DOCK, DOCK), "tour", "already carrying a wheelchair then: undock first"),
        (waypoints_of(*["pass"] * 255), "tour", "a route has at most 254 waypoints, this one has 255"),
        (bad(x=float("inf"), y=float("nan")) + bad(x=2e5), "tour", "; "),
    ],
)
@pytest.mark.parametrize("operation", [Operation.ADD, Operation.REPLACE])
def test_a_route_that_cannot_be_driven_is_refused_in_one_line(story, waypoints, mission_id, why, operation):
    story.start("park")
    refused(story, why, lambda story: story.asks(operation, "a", waypoints, mission_id=mission_id))
    assert "\n" not in story.answer.message
    assert len(story.answer.message) < 1000


def test_many_problems_are_counted(story):
    waypoints = [{**waypoint, "x": float("nan")} for waypoint in waypoints_of(*["pass"] * 9)]
    refused(story, "; and 4 more problems", lambda story: story.asks(Operation.ADD, "a", waypoints))


def test_a_mission_file_has_no_next_part(story):
    refused(story, "an open order carries its route", lambda story: story.happens(opened_file()))


def opened_file() -> ev.EditQueue:
    return ev.edit_queue(
        Operation.ADD,
        lambda mission_id: make_mission("park", mission_id=mission_id),
        order_id="a",
        mission_id="ride",
        origin="fleet",
        priority=100,
        earliest_s=0.0,
        steps=0,
        more_follows=True,
    )


def test_an_id_is_one_order_with_one_route_for_ever(story):
    story.edit(Operation.HOLD)

    def ask(*actions):
        return story.asks(Operation.ADD, "a", waypoints_of(*actions), more_follows=True)

    ask("pass")
    for _ in range(2):
        ask("pass")
        assert (story.answer.success, story.waiting()) == (True, ["a"])
    refused(story, "another route", lambda story: ask("park"))
    refused(story, "another route", lambda story: story.order("a", "pass", mission_id="tour"))
    story.extends("park", first=1)
    ask("pass")
    assert story.answer.success, "as it was first given"
    assert route_of(story) == ["w0", "w1"]
    story.edit(Operation.RELEASE).tick(story.params.next_order_after_s + 3.0)
    ask("pass")
    assert story.answer.success
    story.extends(first=0, more_follows=False).finishes()
    assert state_of(story) is OrderState.COMPLETED
    ask("pass")
    assert story.answer.success
    refused(story, "another route", lambda story: ask("park"))
    again = Story(story.params, story.journal.load())
    refused(again, "another route", lambda story: story.asks(Operation.ADD, "a", waypoints_of("park")))


def test_a_waiting_order_takes_the_place_of_a_ride_with_its_extended_route(story):
    story.start("park").asks(Operation.ADD, "a", waypoints_of("pass"), more_follows=True)
    story.extends("park", first=1, more_follows=False)
    story.asks(Operation.REPLACE, "a", waypoints_of("pass"), more_follows=True)
    assert story.answer.success
    assert route_of(story) == ["w0", "w1"]
    assert not story.kernel.record.queue.current.open


def test_an_own_route_has_no_way_home(story):
    story.brings("park", more_follows=False).given(battery=0.2)
    story.finishes()
    assert (story.state, story.goals(), held(story)) == (State.COMPLETED, [2.0], HeldBy.BATTERY_LOW)


# --- extensions ------------------------------------------------------------------------------------------------------


def test_a_route_extended_before_its_end_is_driven_without_a_stop(story):
    story.brings("pass", "pass").reach(2.0).at(3.0, speed=1.0).tick()
    story.extends("pass", "park", first=2)
    story.clear().at(3.6, speed=0.8).tick()
    assert (story.state, story.goals()) == (State.RUNNING, [6.0]), "the last waypoint of before is only passed"
    assert not [entry for entry in story.log if entry in ("cancel", "cancel all")]


def test_without_an_extension_it_comes_to_rest_at_a_waypoint_to_pass(story):
    story.brings("pass", "pass").reach(2.0).at(3.6, speed=0.8).tick(1.0)
    assert story.state is State.RUNNING
    story.reach(4.0)
    assert (story.state, story.goal, story.status.reason) == (State.WAITING, None, AWAITS)
    status = story.status
    assert (status.current_waypoint, status.waypoints_completed, status.total_waypoints) == ("", 2, 2)
    assert (status.progress, status.eta_s == status.eta_s) == (1.0, False)
    story.tick(60.0)
    assert story.state is State.WAITING


def test_it_waits_and_goes_on_after_a_warning(story):
    at_end(story).tick(60.0).clear()
    story.extends("park", first=2)
    assert (story.answer.success, story.state, story.tick().goals()) == (True, State.RUNNING, [])
    assert "about to start: warning" in story.status.reason
    assert story.departs().goals() == [6.0]
    assert story.journal.records[-1].mission.waypoints[-1].name == "w2"
    story.reach(6.0)
    assert story.state is State.WAITING
    story.extends(first=0, more_follows=False)
    assert (story.answer.success, story.state, state_of(story)) == (True, State.COMPLETED, OrderState.COMPLETED)


@pytest.mark.parametrize("more", [("park",), ()])
def test_a_closed_route_ends(story, more):
    story.brings("pass", "pass").reach(2.0)
    story.extends(*more, first=2, more_follows=False)
    assert story.answer.success
    story.finishes()
    assert (story.state, state_of(story)) == (State.COMPLETED, OrderState.COMPLETED)
    refused(story, "is COMPLETED", lambda story: story.extends("park", first=2))


@pytest.mark.parametrize("waits", [True, False])
def test_what_the_route_contains_is_no_change(story, waits):
    story.brings("pass", "pass", "pass") if not waits else story.edit(Operation.HOLD).asks(
        Operation.ADD, "a", waypoints_of("pass", "pass", "pass"), more_follows=True
    )
    before, saved = story.kernel.record, len(story.journal.records)
    for first, actions in ((0, ["pass"]), (1, ["pass", "pass"]), (0, []), (99, [])):
        story.extends(*actions, first=first)
        assert story.answer.success
    assert (story.kernel.record, len(story.journal.records)) == (before, saved)
    story.extends("pass", "pass", "park", first=1)
    assert route_of(story) == ["w0", "w1", "w2", "w3"], "the part of it that is new"
    story.extends(first=0, more_follows=False)
    saved = len(story.journal.records)
    story.extends("park", first=3, more_follows=False).extends(first=0, more_follows=False)
    assert (story.answer.success, len(story.journal.records)) == (True, saved)


@pytest.mark.parametrize("begin", ["waits", "drives", "at its end", "paused"])
@pytest.mark.parametrize(
    ("why", "act"),
    [
        ("the route has 2 waypoints, the part begins at 3: 1 missing", lambda story: story.extends("park", first=3)),
        ("waypoint 1 of the route is 'w1' already", lambda story: story.extends("park", first=1)),
        (
            "w0 is in the route already",
            lambda story: story.asks(Operation.EXTEND, waypoints=waypoints_of("park"), first=2, more_follows=True),
        ),
        ("is from fleet", lambda story: story.extends("park", first=2, origin="cli")),
        ("there is no origin 'me'", lambda story: story.extends("park", first=2, origin="me")),
        ("there is no order 'b'", lambda story: story.asks(Operation.EXTEND, "b", first=2)),
        ("there is no dock 'nowhere'", lambda story: story.extends({"dock": "nowhere"}, first=2)),
        ("already carrying a wheelchair", lambda story: story.extends(DOCK, DOCK, first=2)),
        ("without an undock before", lambda story: story.extends({"dock": "charger"}, "park", first=2)),
        ("at most 254", lambda story: story.extends(*["pass"] * (MAX_WAYPOINTS - 1), first=2)),
        ("at most 254", lambda story: story.extends(*["pass"] * (MAX_WAYPOINTS + 1), first=2)),
        (
            "Input should be a finite",
            lambda story: story.asks(
                Operation.EXTEND,
                waypoints=[{**waypoints_of("pass", first=2)[0], "x": float("nan")}],
                first=2,
            ),
        ),
        ("it cannot end with its first 1", lambda story: story.extends("pass", first=0, more_follows=False)),
    ],
)
def test_an_extension_that_does_not_fit_changes_nothing(params, begin, why, act):
    story = DockStory(params)
    if begin == "waits":
        story.asks(Operation.ADD, "a", waypoints_of("pass", "pass"), more_follows=True)
    elif begin == "at its end":
        at_end(story)
    else:
        story.brings("pass", "pass")
        story.command(ev.PAUSE) if begin == "paused" else None
    refused(story, why, act)


def test_a_closed_route_is_not_extended(story):
    story.brings("pass", "park", more_follows=False)
    refused(story, "is complete", lambda story: story.extends("park", first=2))
    refused(story, "is complete", lambda story: story.extends("pass", first=0))


def test_the_whole_route_must_dock_in_sequence(params):
    story = DockStory(params)
    story.brings(DOCK).arrive(2.0).tick().docks()
    assert (story.state, story.status.reason) == (State.WAITING, AWAITS)
    refused(story, "already carrying a wheelchair", lambda story: story.extends(DOCK, first=1))
    story.extends("pass", "undock", first=1).departs()
    assert (story.state, story.goal.x) == (State.RUNNING, 4.0), "with the passenger that this order took aboard"
    story.reach(4.0).arrive(6.0).tick().accept().attach(False).ends(True)
    assert story.state is State.WAITING
    refused(story, "no wheelchair is attached then", lambda story: story.extends("undock", first=3))
    story.extends(DOCK, first=3)
    assert story.answer.success


def test_no_extension_starts_in_an_emergency(story):
    at_end(story).given(emergency_stop=True)
    refused(story, "emergency stop is active", lambda story: story.extends("park", first=2))


# --- what may happen in the wait -------------------------------------------------------------------------------------


@pytest.mark.parametrize("stand", [lambda s: s.command(ev.PAUSE), lambda s: s.emergency(True).emergency(False)])
def test_after_a_pause_it_waits_again_or_goes_on_or_ends(story, stand):
    stand(at_end(story))
    assert story.command(ev.RESUME).state is State.WAITING
    assert AWAITS in story.status.reason
    stand(story)
    assert story.extends("park", first=2).goal is None
    assert (story.command(ev.RESUME).state, story.goal.x) == (State.RUNNING, 6.0)
    stand(story.reach(6.0))
    story.extends(first=0, more_follows=False)
    assert story.state in (State.PAUSED, State.STOPPED), "a closed route leaves a pause to a person"
    assert story.command(ev.RESUME).state is State.COMPLETED


def test_a_restart_in_the_wait_comes_back_paused(story):
    at_end(story)
    again = Story(story.params, story.journal.load())
    assert (again.state, current(again)) == (State.PAUSED, "a")
    assert "restarted while WAITING at the end of its open route" in again.status.reason
    assert again.extends("park", first=2).answer.success
    assert (again.state, again.goal) == (State.PAUSED, None)
    assert again.command(ev.RESUME).state is State.RUNNING


def test_lost_localization_in_the_wait_asks_a_person(story):
    at_end(story).given(faults=("LOCALIZATION_LOST",)).tick(story.params.localization_lost_s - 1.0)
    assert story.state is State.WAITING
    story.tick(2.0)
    assert (story.state, "check the pose" in story.status.reason) == (State.PAUSED, True)
    story.given(faults=()).extends("park", first=2).tick(10.0)
    assert (story.answer.success, story.state) == (True, State.PAUSED)
    refused(story, "only a person resumes", lambda story: story.asks(Operation.RESUME))


def test_a_critical_battery_in_the_wait_leads_to_the_safe_place(params):
    story = at_end(Story(params, safe_places=(SafePlace(name="porch", x=1.0, y=0.0, yaw=0.0),)))
    story.given(faults=CRITICAL).tick()
    assert (story.state, story.status.current_waypoint) == (State.RUNNING, "porch")
    for operation in (Operation.PAUSE, Operation.CANCEL):
        refused(story, "drives to the safe place 'porch' first", lambda story, op=operation: story.asks(op))
    assert story.extends("park", first=2).answer.success
    assert (story.status.current_waypoint, story.status.total_waypoints) == ("porch", 3)
    story.reach(1.0)
    assert story.state is State.PAUSED
    assert not story.command(ev.RESUME).status.last_command_accepted
    assert story.given(faults=()).command(ev.RESUME).goal.x == 6.0


def test_after_the_safe_place_it_waits_there(params):
    story = at_end(Story(params, safe_places=(SafePlace(name="porch", x=1.0, y=0.0, yaw=0.0),)))
    story.given(faults=CRITICAL).tick().command(ev.PAUSE)
    assert story.given(faults=()).command(ev.RESUME).state is State.WAITING
    story.given(faults=CRITICAL).tick().departs().reach(1.0)
    assert story.given(faults=()).command(ev.RESUME).state is State.WAITING


@pytest.mark.parametrize("warned", [True, False])
def test_a_passenger_who_comes_aboard_in_the_wait_is_driven_by_a_person_only(story, warned):
    at_end(story).tick(60.0)
    if warned:
        assert story.extends("park", first=2).state is State.RUNNING
    story.happens(ev.PassengerChanged(True))
    assert (story.state, "a passenger came aboard" in story.status.reason) == (State.PAUSED, True)
    story.extends("park", first=2).asks(Operation.RESUME).tick(10.0)
    assert (story.state, story.goal) == (State.PAUSED, None)
    assert story.command(ev.RESUME).state is State.RUNNING


# --- the journal -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("begin", ["waits", "drives", "paused", "at its end"])
@pytest.mark.parametrize("more", [("park",), ()])
def test_an_extension_that_is_not_journaled_is_none(story, begin, more):
    if begin == "waits":
        story.edit(Operation.HOLD).asks(Operation.ADD, "a", waypoints_of("pass", "pass"), more_follows=True)
    elif begin == "at its end":
        at_end(story)
    else:
        story.brings("pass", "pass")
        story.command(ev.PAUSE) if begin == "paused" else None
    goals, goal = story.goals(), story.goal
    undone(story, lambda story: story.extends(*more, first=2, more_follows=bool(more)))
    assert (story.goals(), story.goal) == (goals, goal), "a ride goes on"
    assert story.tick(1.0).goals() == goals
    assert story.extends(*more, first=2, more_follows=bool(more)).answer.success


def test_an_end_that_is_not_journaled_holds_nothing(params):
    story = DockStory(params)
    story.brings(DOCK).arrive(2.0).tick().docks()
    undone(story, lambda story: story.extends(first=0, more_follows=False))
    assert held(story) is HeldBy.NOTHING


def test_a_resume_that_is_not_journaled_leaves_the_fleet_its_pause(params):
    for at_dock in (False, True):
        story = DockStory(params)
        story.brings(DOCK)
        if at_dock:
            story.arrive(2.0).tick().accept()
        story.asks(Operation.PAUSE)
        undone(story, lambda story: story.asks(Operation.RESUME))
        assert story.tick(1.0).goal is None
        assert story.asks(Operation.RESUME).answer.success
        assert story.state in UNDER_WAY


@pytest.mark.parametrize("operation", [Operation.PAUSE, Operation.CANCEL])
def test_a_stop_never_waits_for_the_disk(story, operation):
    story.brings("park").journal.problem = "full"
    story.asks(operation)
    assert (story.answer.success, "full" in story.answer.message) == (True, True)
    assert (story.state in UNDER_WAY, story.goal) == (False, None)
    assert story.queues[-1].paused_by is None
    story.journal.problem = ""
    story.tick(2.0)
    assert story.journal.records[-1].state is story.state, "saved as soon as possible"
    if operation is Operation.PAUSE:
        refused(story, "only a person resumes", lambda story: story.asks(Operation.RESUME))


# --- cancellation ----------------------------------------------------------------------------------------------------


def test_the_giver_cancels_a_waiting_order(story):
    story.edit(Operation.HOLD).asks(Operation.ADD, "a", waypoints_of("pass"), more_follows=True)
    refused(story, "is from fleet", lambda story: story.asks(Operation.CANCEL, origin="touch_screen"))
    for _ in range(2):
        assert story.asks(Operation.CANCEL).answer.success
        assert (story.waiting(), state_of(story)) == ([], OrderState.REMOVED)


@pytest.mark.parametrize("begin", ["drives", "at its end", "paused by the fleet"])
def test_the_giver_cancels_a_ride_and_the_next_order_starts(story, begin):
    if begin == "at its end":
        at_end(story)
    else:
        story.brings("pass", "pass")
    if begin == "paused by the fleet":
        story.asks(Operation.PAUSE)
    story.order("b", "park")
    refused(story, "is from fleet", lambda story: story.asks(Operation.CANCEL, origin="cli"))
    refused(story, "there is no order 'c'", lambda story: story.asks(Operation.CANCEL, "c"))
    for _ in range(2):
        assert story.asks(Operation.CANCEL).answer.success
        assert (story.state, story.goal, state_of(story)) == (State.ABORTED, None, OrderState.ABORTED)
    assert story.status.reason == "aborted by the fleet"
    assert held(story) is HeldBy.NOTHING
    story.tick(story.params.next_order_after_s + 3.0)
    assert current(story) == "b"


def a_person_pauses(story: Story) -> None:
    story.brings("park").command(ev.PAUSE)


def an_emergency(story: Story) -> None:
    story.brings("park").emergency(True).emergency(False).edit(Operation.RELEASE)


def a_passenger(story: Story) -> None:
    story.brings("park").tick(5.0).happens(ev.PassengerChanged(True))


def at_a_chair(story: Story) -> None:
    story.brings(DOCK).arrive(2.0).tick().accept()


def paused_at_a_chair(story: Story) -> None:
    at_a_chair(story)
    story.asks(Operation.PAUSE)


@pytest.mark.parametrize(
    ("begin", "by"),
    [
        (a_person_pauses, HeldBy.MISSION_ABORTED),
        (an_emergency, HeldBy.MISSION_ABORTED),
        (a_passenger, HeldBy.PASSENGER),
        (at_a_chair, HeldBy.MISSION_ABORTED),
        (paused_at_a_chair, HeldBy.MISSION_ABORTED),
    ],
)
def test_a_cancellation_holds_the_queue_where_a_person_has_to_look(params, begin, by):
    story = DockStory(params)
    begin(story)
    assert story.asks(Operation.CANCEL).answer.success
    assert (story.state, story.goal, story.call, held(story)) == (State.ABORTED, None, None, by)
    assert story.queues[-1].reason


@pytest.mark.parametrize("waits", [True, False])
def test_only_an_order_under_way_is_paused_resumed_and_cancelled(story, waits):
    if waits:
        story.edit(Operation.HOLD).asks(Operation.ADD, "a", waypoints_of("pass"))
    else:
        story.brings("park", more_follows=False).finishes()
    for operation in (Operation.PAUSE, Operation.RESUME, *(() if waits else (Operation.CANCEL,))):
        why = "is QUEUED" if waits else "is COMPLETED"
        refused(story, why, lambda story, asked=operation: story.asks(asked))


# --- pauses ----------------------------------------------------------------------------------------------------------


def test_the_fleet_pauses_and_resumes_its_order(story):
    story.brings("pass", "pass")
    for _ in range(2):
        assert story.asks(Operation.PAUSE).answer.success
        assert (story.state, story.goal, story.queues[-1].paused_by) == (State.PAUSED, None, Origin.FLEET)
    assert "paused by the fleet" in story.status.reason
    for _ in range(2):
        assert story.asks(Operation.RESUME).answer.success
        assert (story.state, story.queues[-1].paused_by) == (State.RUNNING, None)
    assert story.goal.x == 2.0


def test_a_person_s_pause_is_never_resumed_by_the_fleet(story):
    story.brings("park").command(ev.PAUSE)
    assert story.queues[-1].paused_by is None
    refused(story, "PAUSED already", lambda story: story.asks(Operation.PAUSE))
    refused(story, "only a person resumes", lambda story: story.asks(Operation.RESUME))


def test_a_person_takes_the_fleet_s_pause_over(story):
    story.brings("park").asks(Operation.PAUSE).command(ev.PAUSE)
    assert (story.status.last_command_accepted, story.queues[-1].paused_by) == (True, None)
    assert "paused by command" in story.status.reason
    refused(story, "only a person resumes", lambda story: story.asks(Operation.RESUME))
    assert story.command(ev.RESUME).state is State.RUNNING


@pytest.mark.parametrize(
    ("happens", "stays"),
    [
        (lambda story: story.emergency(True).emergency(False), False),
        (lambda story: story.given(faults=("LOCALIZATION_LOST",)).tick().given(faults=()), False),
        (lambda story: story.given(faults=("LIDAR_TIMEOUT",)).tick().given(faults=()), False),
        (lambda story: story.given(faults=CRITICAL).tick().given(faults=()), False),
        (lambda story: story.given(safety_known=False).tick().given(safety_known=True), False),
        (lambda story: story.given(manual=True).tick().given(manual=False), False),
        (lambda story: story.happens(ev.PassengerChanged(True)), False),
        (lambda story: story.given(faults=("COLLISION_IMMINENT", "OBSTACLE_NEAR")).tick().given(faults=()), True),
        (lambda story: story.given(faults=("BATTERY_LOW",)).tick().given(faults=()), True),
        (lambda story: story.edit(Operation.HOLD), True),
        (lambda story: story.extends("park", first=1), True),
    ],
)
def test_what_ends_the_fleet_s_pause(story, happens, stays):
    story.brings("park").asks(Operation.PAUSE)
    happens(story)
    assert story.tick(5.0).goal is None
    assert story.queues[-1].paused_by is (Origin.FLEET if stays else None)
    story.asks(Operation.RESUME)
    assert (story.answer.success, story.state is State.RUNNING) == (stays, stays)


@pytest.mark.parametrize(
    "hindrance", [{"emergency_stop": True}, {"faults": ("LOCALIZATION_LOST",)}, {"faults": CRITICAL}]
)
def test_the_fleet_resumes_nothing_that_must_stand(story, hindrance):
    """Also before the next tick ends its ownership."""
    story.brings("park").asks(Operation.PAUSE).given(**hindrance)
    refused(story, ":", lambda story: story.asks(Operation.RESUME))
