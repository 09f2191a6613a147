"""At the dock pose: closing the latch, updating the correction, opening it again, and backing off."""

from __future__ import annotations

from robot_stack.core.docks import Dock
from robot_stack.core.geometry import ZERO_TWIST, Pose2
from robot_stack.docking.latch import LatchCommand, LatchMotion, Motion
from robot_stack.docking.motion import Follower, Point, straight_to
from robot_stack.docking.params import LatchParams, MotionParams, UndockParams
from robot_stack.docking.results import DockCode, Failure, UndockCode
from robot_stack.docking.situation import Step, View
from robot_stack.docking.states import Trigger


class Latching:
    """Closes the latch; without a confirmation opens it again, so that a retry does not push hooks into the dock.

    A station has no latch: reaching the dock pose is enough; of a charger the battery confirms the contact, for
    ``charge_s`` on end: a braking drive charges the battery for a moment, and so does a contact that touches at times.
    ``closed`` is True once the dock is held.
    """

    def __init__(self, dock: Dock, params: LatchParams) -> None:
        self._params = params
        self._kind = dock.kind
        self._elapsed_s = self._charged_s = 0.0
        self._closing: LatchMotion | None = None
        self._opening: LatchMotion | None = None
        self._failure: Failure | None = None
        self.closed = False

    @property
    def opening(self) -> bool:
        """The latch is being opened again: a late confirmation must not count as holding."""
        return self._opening is not None

    @property
    def may_hold(self) -> bool:
        """The latch was commanded to close and has not been confirmed open since."""
        opened = self._opening is not None and self._opening.state is Motion.CONFIRMED
        return self._closing is not None and not opened

    def tick(self, view: View) -> Step:
        if self._kind == "charger" and self._charged_s < self._params.charge_s:
            return self._wait_for_charge(view)
        if self._kind != "wheelchair":
            self.closed = True
            return Step("docked", ZERO_TWIST)
        now_s, inputs = view.situation.now_s, view.situation.latch
        if self._closing is None:
            self._closing = LatchMotion(LatchCommand.CLOSE, now_s, self._params.confirm_timeout_s)
        state = self._closing.update(inputs, now_s)
        if state is Motion.MOVING:
            return Step("closing the latch", ZERO_TWIST, latch=self._closing.command)
        if state is Motion.CONFIRMED:
            self.closed = True
            return Step("latched", ZERO_TWIST)
        if self._failure is None:
            self._failure = Failure(DockCode.LATCH_FAILED, self._closing.problem(inputs))
        return self._open_again(view, self._failure)

    def _wait_for_charge(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        self._charged_s = self._charged_s + view.dt_s if view.situation.charging else 0.0
        if view.situation.charging or self._elapsed_s <= self._params.charge_timeout_s:
            return Step("docked; waiting for the charge", ZERO_TWIST)
        reason = f"the battery is not charged within {self._params.charge_timeout_s:g} s"
        return Step(reason, ZERO_TWIST, Trigger.TRY_FAILED, Failure(DockCode.NOT_CHARGING, reason))

    def _open_again(self, view: View, failure: Failure) -> Step:
        now_s, inputs = view.situation.now_s, view.situation.latch
        if self._opening is None:
            self._opening = LatchMotion(LatchCommand.OPEN, now_s, self._params.confirm_timeout_s)
        state = self._opening.update(inputs, now_s)
        if state is Motion.MOVING:
            return Step(f"{failure.reason}; opening it again", ZERO_TWIST, latch=self._opening.command)
        # A latch that neither closes nor opens may still hold the dock: then the robot must not back off.
        stuck = state is Motion.FAILED
        reason = f"{failure.reason}; {self._opening.problem(inputs)}" if stuck else failure.reason
        return Step(reason, ZERO_TWIST, Trigger.TRY_FAILED, Failure(failure.code, reason, final=stuck))


class LookingOnce:
    """One more sighting of the board at the closed latch: see :mod:`robot_stack.docking.dock_calibration`."""

    def __init__(self, params: LatchParams) -> None:
        self._params = params
        self._elapsed_s = 0.0
        self.finished = False

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        self.finished = len(view.sightings) >= self._params.learn_sightings or self._elapsed_s > self._params.learn_s
        return Step("docked" if self.finished else "latched; measuring the board again", ZERO_TWIST)


class Latched:
    """Holding a dock. Docking does not own the motion, except at a station: other sources drive the robot."""

    def __init__(self, text: str) -> None:
        self._text = text

    def tick(self, view: View) -> Step:
        return Step(self._text)


class Unlatching:
    def __init__(self, params: LatchParams, *, has_latch: bool) -> None:
        self._params = params
        self._has_latch = has_latch
        self._opening: LatchMotion | None = None

    def tick(self, view: View) -> Step:
        if not self._has_latch:
            return Step("leaving", ZERO_TWIST, Trigger.UNLATCHED)
        now_s, inputs = view.situation.now_s, view.situation.latch
        if self._opening is None:
            self._opening = LatchMotion(LatchCommand.OPEN, now_s, self._params.confirm_timeout_s)
        state = self._opening.update(inputs, now_s)
        if state is Motion.MOVING:
            return Step("opening the latch", ZERO_TWIST, latch=self._opening.command)
        if state is Motion.CONFIRMED:
            return Step("latch open", ZERO_TWIST, Trigger.UNLATCHED)
        failure = Failure(UndockCode.UNLATCH_FAILED, self._opening.problem(inputs), final=True)
        return Step(failure.reason, ZERO_TWIST, Trigger.GAVE_UP, failure)


class BackingOff:
    """Backs straight away from the dock on odometry, and checks that a visible dock stays behind."""

    def __init__(self, undock: UndockParams, motion: MotionParams) -> None:
        self._params, self._motion = undock, motion
        self._start: Pose2 | None = None
        self._follower: Follower | None = None
        self._elapsed_s = 0.0
        self._best_m = 0.0
        self._stuck_s = 0.0
        self._board_m: float | None = None  # distance of the board at the start
        self.distance_m = 0.0

    def tick(self, view: View) -> Step:
        self._elapsed_s += view.dt_s
        odom = view.situation.odom
        if odom is None:
            return Step("waiting for odometry", ZERO_TWIST)
        if self._start is None or self._follower is None:
            self._start = odom
            goal = Pose2(-view.approach_sign * self._params.distance_m, 0.0, 0.0)
            start = Point(Pose2(0.0, 0.0, 0.0), ZERO_TWIST)
            self._follower = Follower(straight_to(start, goal, self._motion), self._motion)
        pose = odom.relative_to(self._start)
        self.distance_m = max(0.0, -view.approach_sign * pose.x)
        failure = self._problem(view)
        if failure is not None:
            return Step(failure.reason, ZERO_TWIST, Trigger.GAVE_UP, failure)
        twist = self._follower.step(pose, view.dt_s)
        if self._follower.finished and self.distance_m >= self._params.distance_m - self._params.blocked_m:
            return Step("clear of the dock", ZERO_TWIST, Trigger.CLEAR)
        return Step("backing off", twist)

    def _problem(self, view: View) -> Failure | None:
        p = self._params
        if self.distance_m > self._best_m + p.blocked_m:
            self._best_m, self._stuck_s = self.distance_m, 0.0
        else:
            self._stuck_s += view.dt_s
        if self._stuck_s > p.blocked_s:
            where = f"blocked after {self.distance_m:.2f} m"
            return Failure(UndockCode.BLOCKED, where, final=True)
        if self._elapsed_s > p.timeout_s:
            return Failure(UndockCode.TIMEOUT, f"not clear after {p.timeout_s:.0f} s", final=True)
        if self._dock_follows(view):
            reason = f"the dock follows the robot after {self.distance_m:.2f} m: the latch still holds it"
            return Failure(UndockCode.UNLATCH_FAILED, reason, final=True)
        return None

    def _dock_follows(self, view: View) -> bool:
        """True if the visible board does not stay behind."""
        if view.board is None:
            return False
        if self._board_m is None:
            self._board_m = abs(view.board.x) - self.distance_m
        behind_m = abs(view.board.x) - self._board_m
        p = self._params
        return self.distance_m > p.follows_after_m and behind_m < p.follows_share * self.distance_m
