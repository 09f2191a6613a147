"""Stories of the mission manager in fake time, with a journal in memory and recorded outputs."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from robot_stack.core.config import load
from robot_stack.core.departure import DepartureParams
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.goals import GoalStatus, NavigationEnded, NavigationFeedback, SendGoal
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.mission_library import MissionError
from robot_stack.core.navigation_waits import load_navigation_waits
from robot_stack.core.safe_places import SafePlaces
from robot_stack.mission import events as ev
from robot_stack.mission.kernel import MissionKernel
from robot_stack.mission.orders import Operation, Order, Origin, QueueAnswer, QueueReport
from robot_stack.mission.params import MissionParams
from robot_stack.mission.perform import JournalError, Performer
from robot_stack.mission.record import Record
from robot_stack.mission.states import AT_DOCK, UNDER_WAY, State

TICK_S = 0.1
DEPARTURE = load(DepartureParams, "departure")
DOCKS = {"chair_1": "wheelchair", "charger": "charger"}
STILL = Twist2(0.0, 0.0, 0.0)
# The node's clock, unlike the steady time of a story: it stands still unless a test sets it.
CLOCK_S = 1_700_000_000.0


def warnings_of(params: MissionParams) -> int:
    """The most departure warnings in one try: navigation may go on by itself only while none is due."""
    return 1 + math.ceil(params.progress_timeout_s / DEPARTURE.after_s)


def load_params() -> MissionParams:
    """As the node has them."""
    return load(MissionParams, "mission_manager").with_waits(load_navigation_waits().longest_s)


def waypoints_of(*actions, first=0) -> list[dict]:
    """Waypoints w0, w1, ... at x = 2, 4, ... m, y = 0, yaw = 0, as in a mission file, from number ``first``."""
    return [
        {"name": f"w{i}", "x": 2.0 * (i + 1), "y": 0.0, "yaw": 0.0, "action": action}
        for i, action in enumerate(actions, first)
    ]


def make_mission(*actions, mission_id="ride", home=(0.0, 0.0, 0.0), charger="") -> Mission:
    """Returns a mission with the waypoints of ``waypoints_of``."""
    waypoints = waypoints_of(*actions)
    names = {"en": "Ride", "ja": "走行", "zh": "行驶"}
    x, y, yaw = home
    return Mission.model_validate(
        {"id": mission_id, "name": names, "home": {"x": x, "y": y, "yaw": yaw, "dock": charger}, "waypoints": waypoints}
    )


def _no_file(mission_id: str) -> Mission:
    raise MissionError(f"there is no mission {mission_id!r}")


def request(operation: int, order_id: str, waypoints=(), **fields) -> ev.EditQueue:
    """As the service gets it, from the fleet unless another origin is given."""
    given = {"mission_id": "tour", "origin": "fleet", "priority": 100, "earliest_s": 0.0, "steps": 0, **fields}
    return ev.edit_queue(operation, _no_file, order_id=order_id, waypoints=waypoints, **given)


class MemoryJournal:
    """A journal that keeps its records in memory. If ``problem`` is set, saving fails."""

    def __init__(self, record: Record | None = None) -> None:
        self.records = [record] if record else []
        self.problem = ""

    def load(self) -> Record:
        return self.records[-1] if self.records else Record()

    def save(self, record: Record) -> None:
        if self.problem:
            raise JournalError(self.problem)
        self.records.append(record)


class Story:
    """One mission manager in fake time. Methods that change something return the story."""

    def __init__(
        self, params: MissionParams, record: Record | None = None, problem: str = "", safe_places=(), keepout=None
    ) -> None:
        self.params = params
        self.journal = MemoryJournal(record)
        self.kernel = MissionKernel(params, DEPARTURE, record, problem, DOCKS, SafePlaces(places=safe_places), keepout)
        self.performer = Performer(self.kernel, self.journal, self)
        self.now_s = 1000.0
        self.inputs = ev.Inputs(
            Pose2(0.0, 0.0, 0.0), STILL, False, True, (), 0.8, False, True, True, "IDLE", clock_s=CLOCK_S
        )
        self.log: list[object] = []
        self.warnings: list[float] = []  # published seconds until departure
        self.statuses: list[ev.Status] = []
        self.queues: list[QueueReport] = []
        self.goal: Pose2 | None = None  # that was sent and not cancelled
        self.goal_call = 0  # the number of the newest goal
        self.call: int | None = None  # the docking goal that was sent and not cancelled
        self.performer.start_up(self.inputs, self.now_s)

    # outputs
    def send_goal(self, goal: SendGoal) -> None:
        self.goal, self.goal_call = goal.pose, goal.call
        self.log.append(("goal", goal.pose))

    def cancel_goal(self, everything: bool) -> None:
        self.goal = None
        self.log.append("cancel all" if everything else "cancel")

    def start_docking(self, call: int, kind: Kind, dock_id: str) -> None:
        self.call = call
        self.log.append((kind.value, dock_id))

    def cancel_docking(self, everything: bool) -> None:
        self.call = None
        self.log.append("cancel all docking" if everything else "cancel docking")

    def publish_emergency_stop(self, active: bool) -> None:
        self.log.append(("emergency_stop", active))

    def warn_of_departure(self, remaining_s: float) -> None:
        self.warnings.append(remaining_s)

    def publish_status(self, status: ev.Status) -> None:
        self.statuses.append(status)

    def publish_queue(self, report: QueueReport) -> None:
        self.queues.append(report)

    # inputs
    def happens(self, event: ev.Event) -> Story:
        self.performer.handle(event, self.inputs, self.now_s)
        return self

    def command(self, name: str, mission: Mission | None = None, problem: str = "") -> Story:
        self.happens(ev.Command(name, mission, problem))
        waits = self.state in UNDER_WAY and self.goal is None and self.call is None
        return self.departs() if waits and name in (ev.START_MISSION, ev.RESUME) else self

    def departs(self) -> Story:
        """Ticks until the departure warning, which a long standstill requires, is over."""
        self.tick()
        while "about to start: warning" in self.status.reason:
            self.tick()
        return self

    def stall(self) -> Story:
        """Stands still until one more try has failed. Departure warnings are not part of the try."""
        failed, params = self.kernel.record.failed_tries, self.params
        end_s = self.now_s + params.progress_timeout_s + warnings_of(params) * (DEPARTURE.warning_s + 3 * TICK_S)
        while self.kernel.record.failed_tries == failed:
            assert self.now_s < end_s, "no try failed"
            self.tick()
        return self

    def start(self, *actions) -> Story:
        return self.command(ev.START_MISSION, make_mission(*actions))

    def tick(self, seconds: float = TICK_S) -> Story:
        for _ in range(max(1, round(seconds / TICK_S))):
            self.now_s += TICK_S
            self.happens(ev.Tick())
        return self

    def given(self, **changes) -> Story:
        self.inputs = replace(self.inputs, **changes)
        return self

    def at(self, x: float, y: float = 0.0, yaw: float = 0.0, speed: float = 0.0) -> Story:
        return self.given(pose=Pose2(x, y, yaw), twist=Twist2(speed, 0.0, 0.0))

    def reach(self, x: float) -> Story:
        """Stands at x until the waypoint counts as reached."""
        return self.at(x).tick(self.params.settle_s + 2 * TICK_S)

    def drives(self, distance_m: float, recoveries: int = 0) -> Story:
        """Navigation's feedback: the length left of its plan."""
        return self.happens(NavigationFeedback(self.goal_call, distance_m, recoveries))

    def aborts(self, code: int = 104, reason: str = "gave up") -> Story:
        """Navigation ends the goal."""
        return self.happens(NavigationEnded(self.goal_call, GoalStatus.ABORTED, code, reason))

    def loses_goal(self) -> Story:
        """Navigation does not have the goal any more."""
        return self.happens(NavigationEnded(self.goal_call, GoalStatus.UNKNOWN))

    def emergency(self, active: bool) -> Story:
        self.given(emergency_stop=active)
        return self.happens(ev.EmergencyStopBegan()) if active else self.tick()

    # orders
    def edit(self, operation: Operation, order: Order | None = None, **fields) -> Story:
        return self.happens(ev.EditQueue(operation, order, **fields))

    def order(self, order_id: str, *actions, mission_id: str = "ride", operation=Operation.ADD, **fields) -> Story:
        mission = make_mission(*actions, mission_id=mission_id)
        origin = fields.pop("origin", Origin.FLEET)
        return self.edit(operation, Order(order_id, mission_id, origin, mission=mission, **fields))

    def asks(self, operation: Operation, order_id: str = "a", waypoints=(), **fields) -> Story:
        """A request as the service gets it, from the fleet unless another origin is given."""
        return self.happens(request(operation, order_id, waypoints, **fields))

    def brings(self, *actions, order_id: str = "a", more_follows: bool = True, **fields) -> Story:
        """An order with its own route, which starts at once: the queue is released before."""
        self.edit(Operation.RELEASE)
        self.asks(Operation.ADD, order_id, waypoints_of(*actions), more_follows=more_follows, **fields)
        assert self.answer.success, self.answer.message
        return self.tick(self.params.next_order_after_s + 3.0)

    def extends(self, *actions, first: int, more_follows: bool = True, **fields) -> Story:
        return self.asks(
            Operation.EXTEND, "a", waypoints_of(*actions, first=first), first=first, more_follows=more_follows, **fields
        )

    @property
    def answer(self) -> QueueAnswer:
        return self.kernel.queue_answer

    def waiting(self) -> list[str]:
        """The ids of the orders that wait."""
        return [order.id for order in self.kernel.record.queue.orders]

    def finishes(self) -> Story:
        """Reaches every waypoint left, until the mission has ended, and leaves the last one."""
        while self.state is State.RUNNING:
            assert self.kernel.record.current is not None
            self.at(self.kernel.record.current.x).tick(1.0)
        return self.at(0.0)  # away from the waypoints of the next order

    # state
    @property
    def state(self) -> State:
        return self.kernel.record.state

    @property
    def status(self) -> ev.Status:
        return self.statuses[-1]

    def goals(self) -> list[float]:
        """The x of every goal sent so far."""
        return [entry[1].x for entry in self.log if isinstance(entry, tuple) and entry[0] == "goal"]

    def clear(self) -> Story:
        self.log.clear()
        self.statuses.clear()
        return self


class DockStory(Story):
    """A story with a docking controller whose answers the test chooses."""

    def calls(self) -> list[tuple[str, str]]:
        """Every docking goal sent so far: (dock or undock, dock id)."""
        return [entry for entry in self.log if isinstance(entry, tuple) and entry[0] in ("dock", "undock")]

    def attach(self, attached: bool = True) -> DockStory:
        return self.happens(ev.PassengerChanged(attached))

    def arrive(self, x: float) -> DockStory:
        """Reaches the waypoint of a dock. No docking goal has been sent yet."""
        self.at(x)
        for _ in range(20):
            if self.state in AT_DOCK:
                return self
            self.tick()
        raise AssertionError(f"still {self.state} at {x}")

    def accept(self) -> DockStory:
        return self.happens(ev.DockingAccepted(self.call)).tick()

    def feedback(self, state: str, tries: int = 1, call: int | None = None) -> DockStory:
        return self.happens(ev.DockingFeedback(call or self.call, state, tries)).tick()

    def ends(self, success: bool, reason: str = "", call: int | None = None, safety_stop: bool = False) -> DockStory:
        return self.happens(ev.DockingEnded(call or self.call, success, reason, safety_stop)).tick()

    def docks(self) -> DockStory:
        """Docks successfully."""
        return self.accept().attach().ends(True)

    def called(self) -> int:
        assert self.call is not None, "no docking goal"
        return self.call


@pytest.fixture
def params() -> MissionParams:
    return load_params()


@pytest.fixture
def story(params: MissionParams) -> Story:
    return Story(params)
