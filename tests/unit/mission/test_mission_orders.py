"""Stories of the queue: orders start one after the other, never by themselves after a person has to look."""

from __future__ import annotations

import pytest

from custom_msgs.msg import MissionOrder, MissionQueue
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract.states import HeldBy
from robot_stack.core.config import load
from robot_stack.core.mission_library import MissionError
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission import events as ev
from robot_stack.mission.orders import MAX_ENDED, MAX_ORDERS, Operation, Order, OrderState, Origin
from robot_stack.mission.states import State
from robot_stack.navigation.params import NavigationParams

from .conftest import CLOCK_S, DEPARTURE, DockStory, Story, make_mission

OTHER = make_mission("park", mission_id="other")


@pytest.fixture
def story(params) -> Story:
    """Of a robot whose queue has been released after the start."""
    return released(Story(params))


def released(story: Story) -> Story:
    return story.edit(Operation.RELEASE)


def rests(story: Story) -> Story:
    """Until the next order would have been started, its departure warning included."""
    return story.tick(story.params.next_order_after_s + 3.0)


def held(story: Story) -> HeldBy:
    return story.queues[-1].held_by


def current(story: Story) -> str | None:
    order = story.kernel.record.queue.current
    return order.id if order else None


def ended(story: Story) -> dict[str, OrderState]:
    return {order.id: order.state for order in story.kernel.record.queue.ended}


# --- one after the other ---------------------------------------------------------------------------------------------


def test_orders_start_one_after_the_other(story):
    rests(story.order("a", "park").order("b", "park", "park"))
    assert (story.state, current(story), story.waiting()) == (State.RUNNING, "a", ["b"])
    story.finishes()
    assert (story.state, current(story), ended(story)) == (State.COMPLETED, None, {"a": OrderState.COMPLETED})
    story.tick(story.params.next_order_after_s - 1.0)
    assert story.state is State.COMPLETED
    rests(story)
    assert (story.state, current(story), story.waiting()) == (State.RUNNING, "b", [])
    assert story.finishes().state is State.COMPLETED
    assert rests(story).state is State.COMPLETED


def test_the_start_of_an_order_is_journaled_before_the_goal(story):
    story.order("a", "park").journal.problem = "full"
    rests(story)
    assert story.goals() == []
    assert (story.state, story.waiting(), held(story)) == (State.IDLE, ["a"], HeldBy.JOURNAL)
    story.journal.problem = ""
    assert rests(story).state is State.IDLE, "a person releases it"
    rests(released(story))
    assert (story.state, current(story)) == (State.RUNNING, "a")
    queue = story.journal.records[-1].queue
    assert (queue.orders, queue.current.id) == ((), "a"), "with the mission in one record"


def test_an_order_waits_for_its_time_and_lets_others_pass(story):
    story.order("late", "park", earliest_s=CLOCK_S + 3600.0).order("early", "park")
    rests(story)
    assert current(story) == "early"
    rests(story.finishes())
    assert (story.state, story.waiting()) == (State.COMPLETED, ["late"])
    rests(story.given(clock_s=CLOCK_S + 3600.0))
    assert current(story) == "late"


def test_an_unknown_clock_starts_nothing(story):
    assert rests(story.order("a", "park").given(clock_s=float("nan"))).state is State.IDLE


def test_a_higher_priority_waits_before_a_lower_one_and_a_person_moves_it(story):
    story.edit(Operation.HOLD)
    for name, priority in (("a", 100), ("b", 200), ("c", 100), ("d", 200), ("e", 0)):
        story.order(name, "park", priority=priority)
    assert story.waiting() == ["b", "d", "a", "c", "e"]
    story.edit(Operation.MOVE, order_id="e", steps=-2)
    assert story.waiting() == ["b", "d", "e", "a", "c"]
    story.edit(Operation.MOVE, order_id="b", steps=127)
    assert story.waiting() == ["d", "e", "a", "c", "b"]
    story.order("f", "park", priority=150)
    assert story.waiting() == ["d", "e", "a", "c", "b", "f"], "behind the last one that is not lower"
    story.edit(Operation.REMOVE, order_id="a")
    assert story.waiting() == ["d", "e", "c", "b", "f"]
    assert ended(story) == {"a": OrderState.REMOVED}
    assert [order.id for order in story.journal.records[-1].queue.orders] == story.waiting()


def test_a_start_during_a_ride_is_queued_and_follows(story):
    story.start("park").command(ev.START_MISSION, OTHER)
    assert story.status.last_command_accepted
    assert (story.kernel.record.mission.id, story.waiting()) == ("ride", ["start_1"])
    story.command(ev.START_MISSION, OTHER)
    assert (story.status.last_command_accepted, story.waiting()) == (False, ["start_1"])
    rests(story.finishes())
    assert (story.kernel.record.mission.id, current(story)) == ("other", "start_1")


def test_an_id_of_another_order_is_refused(story):
    story.edit(Operation.HOLD).order("a", "park")
    story.order("a", "park", mission_id="other")
    assert not story.kernel.queue_answer.success
    story.order("a", "park", origin=Origin.CLI)
    assert not story.kernel.queue_answer.success
    assert story.waiting() == ["a"]


# --- the same id is one order ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("order_id", ["", "x" * 65, "a\nb"])
def test_an_id_must_be_usable(story, order_id):
    assert not story.order(order_id, "park").kernel.queue_answer.success
    assert story.waiting() == []


def test_the_queue_is_limited(story):
    story.edit(Operation.HOLD)
    for number in range(MAX_ORDERS):
        assert story.order(f"o{number}", "park").kernel.queue_answer.success
    assert not story.order("one more", "park").kernel.queue_answer.success
    for number in range(MAX_ORDERS):
        story.edit(Operation.REMOVE, order_id=f"o{number}")
    story.order("late", "park").edit(Operation.REMOVE, order_id="late")
    assert len(story.kernel.record.queue.ended) == MAX_ENDED
    assert list(ended(story))[-1] == "late"


@pytest.mark.parametrize("operation", [Operation.REMOVE, Operation.MOVE])
def test_only_a_waiting_order_is_changed(story, operation):
    rests(story.order("a", "park"))
    for order_id in ("a", "nobody's"):
        story.edit(operation, order_id=order_id, steps=1)
        assert not story.kernel.queue_answer.success
        assert order_id in story.kernel.queue_answer.message


# --- what holds the queue --------------------------------------------------------------------------------------------


def abort(story: Story) -> None:
    story.start("park").command(ev.ABORT)


def fail(story: Story) -> None:
    story.start("park").at(0.3)
    for _ in range(3):
        story.stall()


def stop(story: Story) -> None:
    story.emergency(True).emergency(False)


def stop_in_ride(story: Story) -> None:
    stop(story.start("park"))
    story.command(ev.RESUME).finishes()


def drive_by_hand(story: Story) -> None:
    story.given(manual=True).tick().given(manual=False).tick()


def attach(story: Story) -> None:
    story.happens(ev.PassengerChanged(True)).happens(ev.PassengerChanged(False))


def ride_along(story: Story) -> None:
    story.start("park").happens(ev.PassengerChanged(True)).finishes().happens(ev.PassengerChanged(False))


def empty_battery(story: Story) -> None:
    story.given(battery=0.2).tick().given(battery=0.8).tick()


@pytest.mark.parametrize(
    ("happens", "by"),
    [
        (lambda story: story.edit(Operation.HOLD), HeldBy.STAFF),
        (abort, HeldBy.MISSION_ABORTED),
        (fail, HeldBy.MISSION_FAILED),
        (stop, HeldBy.EMERGENCY_STOP),
        (stop_in_ride, HeldBy.EMERGENCY_STOP),
        (drive_by_hand, HeldBy.MANUAL),
        (attach, HeldBy.PASSENGER),
        (ride_along, HeldBy.PASSENGER),
        (empty_battery, HeldBy.BATTERY_LOW),
    ],
)
def test_a_person_releases_the_queue_after(story, happens, by):
    happens(story)
    assert held(story) is by
    assert story.queues[-1].reason.startswith("queue held: ")
    before = story.state
    assert rests(story.order("a", "park")).state is before
    assert current(rests(released(story))) == "a"


@pytest.mark.parametrize("cause", [{"emergency_stop": True}, {"battery": 0.2}, {"faults": ("BATTERY_LOW",)}])
def test_the_queue_is_not_released_while_its_cause_lasts(story, cause):
    story.given(**cause).tick()
    assert not released(story).kernel.queue_answer.success
    assert story.kernel.queue_answer.message
    assert held(story) is not HeldBy.NOTHING


@pytest.mark.parametrize(
    "reason",
    [
        {"pose": None},
        {"safety_known": False},
        {"faults": ("COLLISION_IMMINENT",)},
        {"setting_out": True},
        {"navigation_served": False},
    ],
)
def test_an_order_waits_while_the_robot_cannot_or_must_not_go(story, reason):
    before = {name: getattr(story.inputs, name) for name in reason}
    assert rests(story.order("a", "park").given(**reason)).state is State.IDLE
    assert story.given(**before).tick(story.params.next_order_after_s - 1.0).state is State.IDLE, (
        "all from the beginning"
    )
    assert rests(story).state is State.RUNNING


@pytest.mark.parametrize(
    ("found", "by"),
    [
        ({"planned": True}, HeldBy.MANUAL),  # a goal by hand, or of another client
        ({"docking_state": "SERVOING"}, HeldBy.MANUAL),
        ({"docking_state": "DOCKED"}, HeldBy.DOCKED),
        ({"charging": True}, HeldBy.DOCKED),
    ],
)
def test_a_robot_that_somebody_else_moved_or_docked_waits_for_a_person(story, found, by):
    before = {name: getattr(story.inputs, name) for name in found}
    rests(story.tick(10.0).order("a", "park").given(**found))
    assert (story.state, held(story)) == (State.IDLE, by)
    assert released(story).kernel.queue_answer.success is (by is HeldBy.MANUAL)
    assert rests(story.given(**before)).state is State.IDLE or by is HeldBy.MANUAL
    assert rests(released(story)).state is State.RUNNING


def test_the_plan_of_the_ride_that_has_just_ended_holds_nothing(story):
    rests(story.order("a", "park").order("b", "park"))
    story.finishes().given(planned=True).tick(story.params.goal_retry_s - 1.2)
    rests(story.given(planned=False))
    assert (story.state, current(story), held(story)) == (State.RUNNING, "b", HeldBy.NOTHING)


def test_lost_localization_without_a_ride_waits_for_a_person(story):
    story.order("a", "park").given(faults=("LOCALIZATION_LOST",)).tick(story.params.localization_lost_s + 1.0)
    assert rests(story.given(faults=())).state is State.IDLE
    assert held(story) is HeldBy.LOCALIZATION_LOST


def test_a_release_is_refused_while_localization_is_lost(params):
    story = Story(params).given(faults=("LOCALIZATION_LOST",)).edit(Operation.RELEASE).tick()
    assert (story.answer.success, story.answer.message) == (
        False,
        "localization is lost: set the pose on the map first",
    )
    assert held(story) is HeldBy.RESTART
    story.given(faults=()).edit(Operation.RELEASE).tick(story.params.localization_lost_s + 1.0)
    assert (story.answer.success, held(story)) == (True, HeldBy.NOTHING)


def test_the_fleet_starts_nothing_with_a_passenger_aboard(story):
    story.happens(ev.PassengerChanged(True))
    rests(released(story).order("a", "park"))
    assert (story.state, held(story)) == (State.IDLE, HeldBy.PASSENGER)
    assert not story.edit(Operation.RELEASE, origin=Origin.FLEET).kernel.queue_answer.success
    story.order("b", "park", origin=Origin.TOUCH_SCREEN, priority=200)
    assert current(rests(released(story))) == "b", "a person's order"


def test_people_are_warned_before_each_order(story):
    rests(story.order("a", "park").order("b", "park"))
    story.finishes().tick(story.params.next_order_after_s + 0.5)
    assert (story.state, current(story)) == (State.RUNNING, "b")
    assert "about to start: warning" in story.status.reason


@pytest.mark.parametrize("earliest_s", [-1.0, 2.0**31, float("nan"), float("inf")])
def test_a_time_that_no_message_can_carry_is_refused(story, earliest_s):
    assert not story.order("a", "park", earliest_s=earliest_s).kernel.queue_answer.success
    assert story.waiting() == []


def test_an_order_that_ended_otherwise_is_no_success_when_asked_again(story):
    story.edit(Operation.HOLD).order("a", "park").edit(Operation.REMOVE, order_id="a")
    assert not story.order("a", "park").kernel.queue_answer.success
    assert "is REMOVED" in story.kernel.queue_answer.message


def test_riders_touches_do_not_fill_the_queue(story):
    story.start("park")
    for number in range(20):
        story.command(ev.START_MISSION, make_mission("park", mission_id=f"ride_{number % 10}"))
    assert len(story.waiting()) == 5


def test_an_order_that_cannot_start_holds_the_queue_and_stays(params):
    story = released(DockStory(params))
    rests(story.order("a", {"dock": "nowhere"}))
    assert (story.state, story.waiting(), held(story)) == (State.IDLE, ["a"], HeldBy.MISSION_FAILED)
    assert "there is no dock 'nowhere'" in story.queues[-1].reason


# --- battery ---------------------------------------------------------------------------------------------------------


CRITICAL = ("BATTERY_LOW", "BATTERY_CRITICAL")
NEAR = SafePlace(name="porch", x=1.0, y=0.5, yaw=0.0)
FAR = SafePlace(name="garage", x=-9.0, y=0.0, yaw=0.0)


def test_a_critical_battery_leads_to_the_nearest_safe_place(params):
    story = Story(params, safe_places=(FAR, NEAR)).start("park", "park").happens(ev.PassengerChanged(True))
    story.given(faults=CRITICAL).tick()
    assert story.state is State.RUNNING
    assert story.goal == NEAR.pose
    assert "safe place 'porch'" in story.status.reason
    assert story.journal.records[-1].safe_place == NEAR
    story.at(NEAR.x, NEAR.y).tick(1.0)
    assert (story.state, story.goal) == (State.PAUSED, None)
    assert "at the safe place 'porch'" in story.status.reason
    story.command(ev.RESUME)
    assert (story.state, story.status.last_command_accepted) == (State.PAUSED, False)
    story.given(faults=(), battery=0.8).command(ev.RESUME)
    assert story.goal.x == 2.0, "the ride goes on where it was"
    assert story.finishes().state is State.COMPLETED


def test_the_way_to_a_safe_place_outlives_a_restart(params):
    story = Story(params, safe_places=(NEAR,)).start("park").given(faults=CRITICAL).tick()
    for faults, goal_m in ((CRITICAL, NEAR.x), ((), 2.0)):  # critical as before, or charged meanwhile
        again = Story(params, story.journal.load(), safe_places=(NEAR,)).given(faults=faults)
        assert again.state is State.PAUSED
        assert again.command(ev.RESUME).goal.x == goal_m


# --- change of destination -------------------------------------------------------------------------------------------


def replaces(story: Story, *actions, **fields) -> Story:
    return story.order("new", *actions, mission_id="other", operation=Operation.REPLACE, **fields)


@pytest.mark.parametrize("full", [True, False])
def test_a_change_of_destination_is_journaled_first(story, full):
    story.start("park").clear().journal.problem = "full" if full else ""
    replaces(story, "park")
    assert story.kernel.queue_answer.success is not full
    assert story.kernel.record.mission.id == ("ride" if full else "other")
    assert story.state is State.RUNNING
    assert len(story.goals()) == (0 if full else 1)


def test_no_change_of_destination_at_a_dock_in_a_stop_or_without_a_ride(params):
    def refused(story: Story) -> bool:
        before = story.kernel.record
        replaces(story, "park", origin=Origin.TOUCH_SCREEN)
        return not story.kernel.queue_answer.success and story.kernel.record == before

    assert refused(Story(params))
    docking = DockStory(params).start({"dock": "chair_1"}).arrive(2.0)
    assert refused(docking)
    assert refused(docking.command(ev.PAUSE))
    assert refused(Story(params).start("park").emergency(True))
    assert refused(Story(params).start("park").given(faults=CRITICAL))
    at_charger = DockStory(params).start({"dock": "charger"}, "undock").arrive(2.0).tick().accept().ends(True)
    assert at_charger.state is State.RUNNING
    assert refused(at_charger)


@pytest.mark.parametrize("aboard", [True, False])
def test_the_fleet_does_not_touch_a_passenger_s_ride_or_pause(story, aboard):
    story.start("park").happens(ev.PassengerChanged(aboard))
    if not aboard:
        story.command(ev.PAUSE)
    replaces(story, "park", origin=Origin.FLEET)
    assert not story.kernel.queue_answer.success
    replaces(story, "park", origin=Origin.TOUCH_SCREEN)
    assert story.kernel.queue_answer.success


# --- interruptions ---------------------------------------------------------------------------------------------------


def test_lost_localization_pauses_the_ride_and_asks(story):
    story.start("park").given(faults=("LOCALIZATION_LOST",)).tick(story.params.localization_lost_s - 1.0)
    assert story.state is State.RUNNING, "held by safety"
    story.tick(2.0)
    assert (story.state, story.goal) == (State.PAUSED, None)
    assert "check the pose" in story.status.reason
    story.command(ev.RESUME)
    assert (story.state, story.status.last_command_accepted) == (State.PAUSED, False)
    story.given(faults=()).tick(60.0)
    assert story.state is State.PAUSED
    assert story.command(ev.RESUME).goal.x == 2.0


def test_localization_lost_for_a_moment_pauses_nothing(story):
    story.start("park")
    for _ in range(5):
        story.given(faults=("LOCALIZATION_LOST",)).tick(0.6 * story.params.localization_lost_s)
        story.given(faults=()).tick(1.0)
    assert story.state is State.RUNNING


# --- one source for the patience -------------------------------------------------------------------------------------


def test_a_try_outlasts_navigations_own_waits(story):
    """At a gate navigation waits for a person and then, without a path, gives up with a reason of its own."""
    navigation = load(NavigationParams, "navigation_controller")
    longest_s = navigation.passage.wait_s + navigation.follow.give_up_s
    begun_s = story.start("park").now_s
    assert story.at(0.3).stall().kernel.record.failed_tries == 1
    warnings_s = 2.0 * (DEPARTURE.warning_s + 0.3)  # for which the robot stands by the mission manager's own will
    assert longest_s + 1.0 < story.now_s - begun_s - warnings_s < longest_s + story.params.progress_reserve_s + 1.0


def test_a_recovery_of_navigation_starts_the_time_of_a_try_again(story):
    begun_s = story.start("park").at(0.3).now_s
    story.tick(9.0).drives(1.7, recoveries=1).stall()
    assert story.now_s - begun_s > story.params.progress_timeout_s + 9.0
    assert story.kernel.record.failed_tries == 1


def test_a_timeout_that_is_set_is_kept(params):
    assert params.model_copy(update={"progress_timeout_s": 2.0}).with_waits(22.0).progress_timeout_s == 2.0


# --- requests from the wire ------------------------------------------------------------------------------------------


def asked(operation: int, **changes) -> ev.EditQueue:
    fields = {"order_id": "a", "mission_id": "other", "origin": "fleet", "priority": 7, "earliest_s": 5.0, "steps": -2}

    def find(mission_id: str):
        if mission_id != "other":
            raise MissionError(f"there is no mission {mission_id!r}")
        return OTHER

    return ev.edit_queue(operation, find, **{**fields, **changes})


def test_requests_from_the_wire(story):
    assert asked(0).order == Order("a", "other", Origin.FLEET, 7, 5.0, mission=OTHER)
    assert asked(2) == ev.EditQueue(Operation.MOVE, order_id="a", steps=-2, origin=Origin.FLEET)
    for request, why in (
        (asked(10), "there is no operation 10"),
        (asked(0, origin="stranger"), "there is no origin 'stranger'"),
        (asked(5, mission_id="nowhere"), "there is no mission 'nowhere'"),
    ):
        story.happens(request)
        assert not story.kernel.queue_answer.success
        assert why in story.kernel.queue_answer.message


def test_the_numbers_are_those_of_the_messages():
    for kind, message in (
        (HeldBy, MissionQueue),
        (OrderState, MissionOrder),
        (Operation, EditMissionQueue.Request),
    ):
        assert {item.name: item.value for item in kind} == {item.name: getattr(message, item.name) for item in kind}
    assert {origin.value for origin in Origin} == {getattr(MissionOrder, origin.name) for origin in Origin}
