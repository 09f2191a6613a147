"""For any events in any order: no motion while paused, stopped or in an emergency."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.contract.states import HeldBy
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.goals import GoalStatus, NavigationEnded, NavigationFeedback, SendGoal
from robot_stack.core.mission import Kind
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation, Order, Origin
from robot_stack.mission.record import Record, problem_of
from robot_stack.mission.states import ACTIVE, AT_DOCK, UNDER_WAY, State, Trigger, target_of

from .conftest import Story, load_params, make_mission, request, waypoints_of

PARAMS = load_params()
DOCK = {"dock": "chair_1"}
MISSIONS = [
    make_mission("pass", {"wait": 0.3}, "park"),
    make_mission(DOCK, "undock", "park"),
    make_mission({"dock": "charger"}),
    make_mission("undock"),
    None,
]

coordinates = st.sampled_from([0.0, 1.6, 2.0, 4.0, 6.0, float("nan"), float("inf"), -1e9])
poses = st.none() | st.builds(Pose2, coordinates, st.just(0.0), st.sampled_from([0.0, 3.0, float("nan")]))
twists = st.none() | st.builds(Twist2, st.sampled_from([0.0, 1.0, float("nan")]), st.just(0.0), st.just(0.0))
faults = st.sampled_from(
    [
        (),
        ("COLLISION_IMMINENT",),
        ("BATTERY_LOW",),
        ("BATTERY_LOW", "BATTERY_CRITICAL"),
        ("LOCALIZATION_LOST",),
        ("NOT_A_FAULT",),
    ]
)
changes = st.one_of(
    st.fixed_dictionaries({"pose": poses, "twist": twists}),
    st.fixed_dictionaries({"emergency_stop": st.booleans()}),
    st.fixed_dictionaries({"safety_known": st.booleans()}),
    st.fixed_dictionaries({"faults": faults}),
    st.fixed_dictionaries({"battery": st.sampled_from([0.8, 0.1, float("nan")]), "charging": st.booleans()}),
    st.fixed_dictionaries({"planned": st.booleans(), "navigation_served": st.booleans()}),
    st.fixed_dictionaries(
        {"docking_served": st.booleans(), "docking_state": st.sampled_from(["", "IDLE", "SERVOING", "DOCKED"])}
    ),
)
calls = st.integers(0, 4)
docking = st.one_of(
    st.builds(ev.DockingAccepted, calls),
    st.builds(ev.DockingFeedback, calls, st.sampled_from(["APPROACH", "FINE_ALIGN", "DOCKED", "?"]), st.integers(0, 3)),
    st.builds(ev.DockingEnded, calls, st.booleans(), st.sampled_from(["", "why"]), st.booleans()),
)
navigation = st.one_of(
    st.builds(
        NavigationFeedback, calls, st.sampled_from([0.0, 1.0, 9.0, float("nan"), float("inf")]), st.integers(0, 3)
    ),
    st.builds(NavigationEnded, calls, st.sampled_from(GoalStatus), st.sampled_from([0, 104, 208]), st.just("why")),
)
names = st.sampled_from([*ev.COMMANDS, "", "fly"])
commands = st.builds(ev.Command, names, st.sampled_from(MISSIONS), st.just("unknown"))
missions = st.sampled_from([mission for mission in MISSIONS if mission is not None])
orders = st.builds(
    lambda number, mission, priority: Order(f"order_{number}", "ride", Origin.FLEET, priority, mission=mission),
    st.integers(0, 5),
    missions,
    st.integers(99, 101),
)
requests = st.builds(
    ev.EditQueue,
    st.sampled_from(Operation),
    orders,
    order_id=st.integers(0, 5).map("order_{}".format),
    steps=st.integers(-2, 2),
)
own_requests = st.builds(
    lambda operation, order_id, origin, actions, first, more_follows: request(
        operation,
        order_id,
        waypoints_of(*actions, first=first if operation is Operation.EXTEND else 0),
        origin=origin,
        first=first,
        more_follows=more_follows,
    ),
    st.sampled_from([*Operation, Operation.EXTEND, Operation.EXTEND, Operation.RELEASE]),
    st.sampled_from(["order_0", "order_0", "order_0", "order_1"]),
    st.sampled_from(["fleet", "fleet", "fleet", "cli"]),
    st.lists(st.sampled_from(["pass", "park", {"wait": 0.2}, DOCK, "undock"]), max_size=3),
    st.integers(0, 4),
    st.booleans(),
)
happenings = st.one_of(
    commands,
    requests,
    own_requests,
    st.just(ev.EditQueue(Operation.RELEASE)),
    st.builds(ev.EmergencyStopBegan),
    navigation,
    st.builds(ev.PassengerChanged, st.booleans()),
    docking,
    st.builds(ev.Tick),
    st.builds(ev.Tick),
)
durations = st.sampled_from([0.0, 0.1, 0.1, 0.4, 20.0, -50.0])
disks = st.sampled_from(["", "", "", "full"])
steps = st.lists(st.tuples(durations, st.none() | changes, happenings, disks), max_size=60)


class Watched(Story):
    """Asserts the preconditions whenever a goal is sent."""

    def send_goal(self, goal: SendGoal) -> None:
        assert goal.call > self.goal_call, "no number is used twice"
        super().send_goal(goal)
        assert self.state is State.RUNNING
        assert not self.inputs.emergency_stop
        assert self.journal.records[-1].state is State.RUNNING, "the journal knew first"
        assert goal.pose.is_finite()

    def start_docking(self, call: int, kind: Kind, dock_id: str) -> None:
        super().start_docking(call, kind, dock_id)
        assert self.state is (State.DOCKING if kind is Kind.DOCK else State.UNDOCKING)
        assert not self.inputs.emergency_stop
        assert self.journal.records[-1].state is self.state, "the journal knew first"
        assert call > max(self.started, default=0), "no number is used twice"
        assert not self.started - self.ended, "one goal at a time"
        assert self.goal is None, "two masters"
        self.started.add(call)

    def happens(self, event: ev.Event) -> Story:
        if isinstance(event, ev.DockingEnded):
            self.ended.add(event.call)
        if isinstance(event, ev.Tick) and not self.inputs.docking_served:
            self.ended |= self.started  # goals end with the docking controller
        return super().happens(event)

    def __init__(self, *args) -> None:
        self.started: set[int] = set()
        self.ended: set[int] = set()
        super().__init__(*args)


def at_dock(story: Story) -> None:
    """Starts docking, a state that random events rarely reach."""
    story.start(DOCK, "undock", "park").reach(2.0)
    assert story.state is State.DOCKING


def at_undock(story: Story) -> None:
    story.happens(ev.PassengerChanged(True)).start("undock", DOCK).reach(2.0)
    assert story.state is State.UNDOCKING


def at_open_end(story: Story) -> None:
    story.brings("pass", order_id="order_0").reach(2.0)
    assert story.state is State.WAITING


openings = st.sampled_from([lambda story: None, at_dock, at_undock, at_open_end])
places = st.sampled_from([(), (SafePlace(name="base", x=3.0, y=0.0, yaw=0.0),)])


@settings(max_examples=200, deadline=None)
@given(openings, places, steps)
def test_whatever_happens_nothing_moves_unasked_and_a_power_loss_loses_nothing(opening, safe_places, script):
    story = Watched(PARAMS, None, "", safe_places)
    opening(story)
    accepted: set[str] = set()
    for dt_s, change, event, problem in script:
        story.now_s += dt_s
        story.journal.problem = problem
        story.given(**(change or {}))
        before = story.kernel.record
        story.happens(event)
        check_step(story, event, before.state)
        if isinstance(event, ev.EditQueue) and not story.answer.success:
            assert story.kernel.record.queue == before.queue
        elif isinstance(event, ev.EditQueue) and event.operation in (Operation.ADD, Operation.REPLACE):
            assert event.order is not None
            accepted.add(event.order.id)
    for status in story.statuses:
        check_status(status)
    check_restart(story.journal.load(), accepted)


def check_step(story: Watched, event: ev.Event, before: State) -> None:
    if story.state not in UNDER_WAY:
        assert story.goal is None, f"a goal is left behind in {story.state}"
    if story.state not in AT_DOCK:
        assert story.call is None or story.call in story.ended, f"a docking is left behind in {story.state}"
    if isinstance(event, ev.Tick) and story.inputs.emergency_stop:
        assert story.state not in UNDER_WAY
        assert story.state is not State.PAUSED
    assert not problem_of(story.kernel.record)
    # With a full disk one event takes two steps: on to the next waypoint, then paused.
    ways = {target_of(before, trigger) for trigger in Trigger} | ({State.PAUSED} if before in UNDER_WAY else set())
    assert story.state is before or story.state in ways


def check_status(status: ev.Status) -> None:
    assert 0.0 <= status.progress <= 1.0
    assert not status.eta_s < 0.0
    assert 0 <= status.waypoints_completed <= status.total_waypoints <= 255
    assert status.state in {"IDLE", "RUNNING", "WAITING", "PAUSED", "COMPLETED", "ABORTED", "FAILED"}
    assert status.last_command_accepted or not status.last_command or "refused" in status.reason


def check_restart(kept: Record, accepted: set[str]) -> None:
    """accepted: ids of orders, which are known whatever has happened to them since."""
    again = Story(PARAMS, kept)
    assert (again.goal, again.call) == (None, None)
    assert again.state is (State.PAUSED if kept.state in ACTIVE else State.IDLE)
    assert again.kernel.record.passenger_attached == kept.passenger_attached
    assert again.kernel.record.queue == kept.queue
    assert all(kept.queue.known(order_id) is not None for order_id in accepted)
    assert again.queues[-1].held_by is HeldBy.RESTART
    if again.state is State.PAUSED:
        assert (again.kernel.record.mission, again.kernel.record.waypoint) == (kept.mission, kept.waypoint)


# --- orders with their own route -------------------------------------------------------------------------------------

own_happenings = st.one_of(
    own_requests,
    own_requests,
    st.sampled_from([ev.PAUSE, ev.RESUME, ev.ABORT, ev.EMERGENCY_STOP]).map(ev.Command),
    st.sampled_from(
        [
            {"emergency_stop": True},
            {"emergency_stop": False},
            {"faults": ("BATTERY_LOW", "BATTERY_CRITICAL")},
            {"faults": ()},
        ]
    ),
    st.builds(ev.PassengerChanged, st.booleans()),
    st.sampled_from(["on", "on", "restart"]),
)


def takes_place(story: Story, happening) -> Story:
    match happening:
        case "on":
            place = story.kernel.record.current
            return story.tick(15.0) if place is None else story.at(place.x).tick(3.0)
        case "restart":
            return Story(PARAMS, story.journal.load())
        case dict():
            return story.given(**happening).tick()
    return story.happens(happening)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(own_happenings, st.sampled_from(["", "", "", "full"])), max_size=20))
def test_any_requests_leave_a_valid_record_and_a_refused_one_leaves_it_as_it_was(script):
    story = Story(PARAMS).brings("pass", "pass", order_id="order_0")
    for happening, problem in script:
        story.journal.problem = problem
        before, paused_by = story.kernel.record, story.queues[-1].paused_by
        story = takes_place(story, happening)
        record = story.kernel.record
        assert problem_of(record) == ""
        assert story.queues[-1].paused_by is None or story.state is State.PAUSED
        if not isinstance(happening, ev.EditQueue):
            continue
        if not story.answer.success:
            assert (record, story.queues[-1].paused_by) == (before, paused_by)
        if happening.operation is Operation.RESUME and before.state in (State.PAUSED, State.STOPPED):
            assert record.state is before.state or paused_by is happening.origin
