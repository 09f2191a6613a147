"""The docking controller: executes a docking or undocking, one output per tick.

The transitions are in ``states``; each state is one class of ``phases``; the conditions monitored in
every state are in ``guard``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.states import SERVOED, DockingState
from robot_stack.core.departure import SETTING_OUT, Departure
from robot_stack.core.docks import Dock
from robot_stack.core.geometry import ZERO_TWIST, Pose2, exp_se2
from robot_stack.core.goals import NavigationEvent, NavigationGoals
from robot_stack.docking.dock_calibration import Correction, learnt
from robot_stack.docking.dock_tracker import DockTracker
from robot_stack.docking.guard import Guard, held
from robot_stack.docking.latch import LatchCommand, LatchKeeper, LatchMotion, Motion
from robot_stack.docking.params import DockingParams
from robot_stack.docking.phases.latching import BackingOff, Latched, Latching, LookingOnce, Unlatching
from robot_stack.docking.phases.search import Search
from robot_stack.docking.phases.servoing import FineAlign, Servoing
from robot_stack.docking.phases.staging import BackToStaging, DriveToStaging
from robot_stack.docking.results import Code, DockCode, Failure, Result, UndockCode
from robot_stack.docking.sighting import Marker
from robot_stack.docking.situation import Output, Situation, Step, View
from robot_stack.docking.states import Trigger, target_of

_WAYS = {"front": 1.0, "rear": -1.0}
# States that start motion from standstill. FINE_ALIGN continues SERVOING, so slowly that it looks like standing.
_MOVING = (Search, Servoing, BackToStaging, BackingOff)
_LET_GO = "the latch has let go of the wheelchair by itself"


def _errors(base: Pose2 | None) -> tuple[float, float]:
    """(distance to the dock pose, yaw to turn by), NaN while unknown."""
    return (math.nan, math.nan) if base is None else (math.hypot(base.x, base.y), -base.yaw)


class Phase(Protocol):
    def tick(self, view: View) -> Step: ...


class _Idle:
    """No job. ``text``: how the last one ended."""

    def __init__(self, text: str = "idle") -> None:
        self._text = text

    def tick(self, view: View) -> Step:
        return Step(self._text)


class DockingController:
    """One job at a time. Times are ROS time.

    mountings: (4, 4) optical frame in base_link by camera frame. departure: tracks whether a warning must precede
    motion. corrections: by dock id, from earlier dockings.
    """

    def __init__(
        self,
        params: DockingParams,
        mountings: Mapping[str, NDArray[np.float64]],
        departure: Departure,
        corrections: Mapping[str, Correction] | None = None,
    ) -> None:
        self._params = params
        self.corrections = dict(corrections or {})
        self.tracker = DockTracker(params.target, mountings)
        self._departure = departure
        self._goals = NavigationGoals(params.staging.goal_retry_s)
        self._keeper = LatchKeeper()
        self._guard = Guard(params, undocking=False)
        self._opening: LatchMotion | None = None  # of hooks that would block the dock
        self._state = DockingState.IDLE
        self._phase: Phase = _Idle()
        self._dock_id = ""
        self._dock: Dock | None = None
        self._undocking = False
        self._station = ""  # the robot has docked to it and has not cleared it yet
        self._charging = False
        self._driven_off = Pose2(0.0, 0.0, 0.0)  # since then by other sources: base_link in its pose at the station
        self._tries = 0
        self._staging = 0  # index of the staging pose of this try
        self._unreachable: set[int] = set()  # staging poses that navigation gave up in this job
        self._now_s = math.nan
        self._commanded = ZERO_TWIST
        self._distance_m = 0.0
        self._text = "idle"

    @property
    def state(self) -> DockingState:
        return self._state

    @property
    def busy(self) -> bool:
        """A docking or undocking is under way."""
        return not isinstance(self._phase, (_Idle, Latched))

    def target(self, base: Pose2 | None) -> Pose2 | None:
        """The dock's present frame in base_link while the robot moves into the dock, else None. base: in odom."""
        dock = self.tracker.estimate
        if self._state not in SERVOED or dock is None or base is None:
            return None
        return dock.pose.relative_to(base)

    @property
    def dock_id(self) -> str:
        """The dock of the present or the last job, empty before any."""
        return self._dock_id

    @property
    def attached(self) -> bool | None:
        """A wheelchair is attached, or has come loose and not been undocked from. None while unknown."""
        return self._keeper.attached

    @property
    def closed(self) -> bool:
        """The latch is confirmed closed, by the last inputs that could be read."""
        return self._keeper.holding

    @property
    def undocking(self) -> bool:
        """An undocking is under way."""
        return self._undocking and self.busy

    @property
    def station(self) -> str:
        """Id of the station or charger that the robot has docked to and has not cleared yet, else empty."""
        return self._station

    def recall(self, attached: bool) -> None:
        """Sets, before the first tick, whether a wheelchair was attached at the end of the previous controller."""
        self._keeper.recall(attached)

    def recall_station(self, dock_id: str, dock: Dock) -> None:
        """Sets, before the first tick, the station of the previous controller."""
        self._station = self._dock_id = dock_id
        self._dock = dock
        self._text = "docked"

    # --- requests ----------------------------------------------------------------------------------------------------

    def dock(self, dock_id: str, dock: Dock, *, approach_only: bool = False) -> Result | None:
        """Starts docking. Returns the refusal, None if it has started."""
        if self.busy:
            return Result(DockCode.BUSY, f"busy: {self._text}")
        if self._keeper.attached:
            return Result(DockCode.ALREADY_ATTACHED, "a wheelchair is attached already")
        docked_there = self._station == dock_id and dock.kind == "charger" and self._state is DockingState.DOCKED
        if self._station and (not docked_there or approach_only):
            return Result(DockCode.ALREADY_ATTACHED, f"docked at {self._station!r}: undock first")
        if self._keeper.attached is None:
            return Result(DockCode.LATCH_FAILED, "the latch's inputs cannot be read")
        self._dock_id, self._dock = dock_id, dock
        self._undocking, self._tries, self._distance_m = False, 1, 0.0
        self._staging, self._unreachable = 0, set()
        self._guard = Guard(self._params, undocking=False)
        self.tracker.look_for(dock, self.corrections.get(dock_id, Correction()))
        # Where the robot is docked, the charge is confirmed once more.
        phase = Latching(dock, self._params.latch) if docked_there else self._drive_to_staging(dock, only=approach_only)
        self._enter(Trigger.DOCK, phase)
        return None

    def undock(self, situation: Situation) -> Result | None:
        """Starts undocking. Returns the refusal, None if it has started."""
        refusal = self._undock_refusal(situation)
        if refusal is not None:
            return refusal
        self._undocking, self._tries, self._distance_m = True, 1, 0.0
        self._guard = Guard(self._params, undocking=True)
        if self._keeper.attached and self._dock is not None and self._dock.kind != "wheelchair":
            self._dock_id, self._dock = "", None  # of an earlier job: the wheelchair was latched by hand
        self.tracker.look_for(self._dock, self.corrections.get(self._dock_id, Correction()))
        self._enter(Trigger.UNDOCK, Unlatching(self._params.latch, has_latch=bool(self._keeper.attached)))
        return None

    def _undock_refusal(self, situation: Situation) -> Result | None:
        p, twist, safety = self._params.undock, situation.twist, situation.safety
        if self.busy:
            return Result(UndockCode.BUSY, f"busy: {self._text}")
        if not self._keeper.attached and not self._station:
            return Result(UndockCode.NOT_ATTACHED, "nothing is attached")
        if safety.emergency or not safety.known:
            return Result(UndockCode.SAFETY_STOP, "emergency stop" if safety.known else "no fresh /safety/status")
        if twist is None or twist.speed() > p.standing_mps or abs(twist.omega) > p.standing_radps:
            return Result(UndockCode.ROBOT_MOVING, "the robot moves" if twist else "no fresh /odom")
        if "SLOPE" in safety.faults:
            return Result(UndockCode.SLOPE_TOO_STEEP, "the slope is above 5 deg")
        if self._keeper.attached and self._station:
            why = f"the wheelchair was latched at {self._station!r}: drive {p.distance_m:g} m clear by hand first"
            return Result(UndockCode.BLOCKED, why)
        return None

    def cancel(self) -> Result | None:
        """Ends the job with the robot standing; None if there is none."""
        if not self.busy:
            return None
        code = UndockCode.CANCELED if self._undocking else DockCode.CANCELED
        self._text = "cancelled"
        self._enter(Trigger.CANCELLED, self._resting_phase(self._text))
        return self._result(code, "cancelled", None)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def on_odometry(self, stamp_s: float, pose: Pose2) -> None:
        """Adds base_link in odom, which must be finite."""
        self.tracker.on_odometry(stamp_s, pose)

    def on_markers(self, markers: Sequence[Marker]) -> None:
        """Adds the markers of all cameras' newest images."""
        self.tracker.on_markers(markers)

    def on_navigation(self, event: NavigationEvent) -> None:
        """Adds an event of a goal that an output sent."""
        self._goals.on_event(event)

    # --- tick --------------------------------------------------------------------------------------------------------

    def tick(self, situation: Situation) -> Output:
        """One step. Never returns a twist that is not finite."""
        dt_s = situation.now_s - self._now_s
        self._now_s = situation.now_s
        dt_s = min(dt_s, self._params.motion.longest_step_s) if dt_s > 0.0 else 0.0
        self._departure.elapse(situation.twist, dt_s)
        was_busy = self.busy
        lost = self._watch_latch(situation)
        self._watch_station(situation, dt_s)
        self._charging = situation.charging
        view = self._view(situation, dt_s)
        failure = self._guard.check(situation, self._state, dt_s) if self.busy else None
        if failure is not None:
            step = Step(failure.reason, ZERO_TWIST, Trigger.TRY_FAILED, failure)
        elif self.busy and held(situation):
            self._departure.drop()
            step = Step("stopped by safety", ZERO_TWIST)
        elif self._must_open(situation):
            step = self._open_first(situation)
        elif self._warns(dt_s):
            step = Step(SETTING_OUT, ZERO_TWIST)
        else:
            step = self._phase.tick(view)
        if self._station and not self.busy:
            # Another client's goal must not pull it off, or push it into the station; a joystick precedes this command.
            step = replace(step, twist=ZERO_TWIST)
        output = self._act(step, view)
        if not lost:
            return output
        ended = self._result(DockCode.LATCH_FAILED, _LET_GO, view) if was_busy else None
        return replace(output, emergency=True, result=ended)

    def _warns(self, dt_s: float) -> bool:
        """True while people are being warned before motion after a long standstill, unless navigation does so."""
        if not isinstance(self._phase, _MOVING):
            self._departure.drop()
            return False
        return not self._departure.cleared(dt_s)

    def _act(self, step: Step, view: View) -> Output:
        self._text = step.text
        if isinstance(self._phase, BackingOff):
            self._distance_m = self._phase.distance_m
        result = self._advance(step, view)
        finite = step.twist is None or step.twist.is_finite()
        twist = step.twist if finite else ZERO_TWIST
        self._commanded = twist or ZERO_TWIST
        position_m, yaw_rad = _errors(view.base)
        return Output(
            state=self._state,
            text=self._text,
            twist=twist,
            latch=step.latch,
            attached=self._keeper.attached,
            position_error_m=position_m,
            yaw_error_rad=yaw_rad,
            progress=self._progress(position_m),
            tries=self._tries,
            distance_m=self._distance_m,
            goal=step.goal,
            cancel_goal=not isinstance(self._phase, DriveToStaging) and self._goals.must_cancel(view.dt_s),
            result=result,
        )

    def _must_open(self, situation: Situation) -> bool:
        """True before the dock if the hooks are not open: they would block it, or still hold another one."""
        inputs = situation.latch
        before = self.busy and self._state in (DockingState.APPROACH, DockingState.SEARCH)
        due = before and inputs.known and not inputs.open and not self._keeper.attached
        self._opening = self._opening if due else None
        return due

    def _open_first(self, situation: Situation) -> Step:
        """Opens the hooks while the robot stands."""
        if self._opening is None:
            timeout_s = self._params.latch.confirm_timeout_s
            self._opening = LatchMotion(LatchCommand.OPEN, situation.now_s, timeout_s)
        if self._opening.update(situation.latch, situation.now_s) is Motion.FAILED:
            failure = Failure(DockCode.LATCH_FAILED, self._opening.problem(situation.latch), final=True)
            return Step(failure.reason, ZERO_TWIST, Trigger.TRY_FAILED, failure)
        return Step("opening the latch", ZERO_TWIST, latch=self._opening.command)

    def _advance(self, step: Step, view: View) -> Result | None:
        """Executes the transition of a step. Returns the result if the job is over."""
        phase = self._phase
        if isinstance(phase, Latching) and phase.closed:
            self._phase = LookingOnce(self._params.latch)
            assert self._dock is not None
            if self._dock.kind != "wheelchair":
                self._arrive_at_station()
            self.tracker.count_from(self._now_s + self._params.latch.learn_after_s)
        elif isinstance(phase, LookingOnce) and phase.finished:
            return self._docked(view)
        if step.trigger is None:
            return None
        if step.failure is not None and step.trigger is not Trigger.LOST:
            return self._give_up(step.failure, view)
        if isinstance(phase, BackToStaging) and self._staging:
            assert self._dock is not None
            self._phase = self._drive_to_staging(self._dock)  # from before the dock, where navigation finds a way
            return None
        if step.trigger in (Trigger.STAGED_ONLY, Trigger.CLEAR):
            if step.trigger is Trigger.CLEAR:
                self._keeper.released()
                self._station = ""
            self._enter(step.trigger, _Idle())
            return self._result(DockCode.NONE, "", view)
        self._enter(step.trigger, self._next_phase(step.trigger))
        return None

    def _next_phase(self, trigger: Trigger) -> Phase:
        p = self._params
        if trigger is Trigger.UNLATCHED:
            return BackingOff(p.undock, p.motion)
        if trigger in (Trigger.STAGED, Trigger.LOST):
            last = self.tracker.dock_pose_in_odom() if trigger is Trigger.LOST else None
            if trigger is Trigger.STAGED:
                self._guard.begin_try()
            self.tracker.forget()
            return Search(last, p.search, p.motion)
        if trigger is Trigger.FOUND:
            return Servoing(p)
        if trigger is Trigger.NEAR:
            assert isinstance(self._phase, Servoing)
            return FineAlign(self._phase.follower, p)
        assert trigger is Trigger.ALIGNED
        assert self._dock is not None
        return Latching(self._dock, p.latch)

    def _drive_to_staging(self, dock: Dock, *, only: bool = False) -> DriveToStaging:
        elsewhere = not only and len(dock.stagings) - len(self._unreachable) > 1
        pose = dock.stagings[self._staging].pose()
        return DriveToStaging(pose, self._goals, self._params.staging, only=only, elsewhere=elsewhere)

    def _next_staging(self, dock: Dock) -> int:
        """The next staging pose that navigation has not given up; after the last one the first again."""
        count = len(dock.stagings)
        following = ((self._staging + step) % count for step in range(1, count + 1))
        return next(index for index in following if index not in self._unreachable)

    def _give_up(self, failure: Failure, view: View) -> Result | None:
        """The job, or only this try."""
        if failure.elsewhere:
            self._unreachable.add(self._staging)
        elif failure.final or self._undocking or self._tries >= self._params.tries:
            self._enter(Trigger.GAVE_UP, self._resting_phase(failure.reason))
            return self._result(failure.code, failure.reason, view)
        assert self._dock is not None
        back = self.tracker.dock_pose_in_odom()
        self._staging = self._next_staging(self._dock)
        phase: Phase = self._drive_to_staging(self._dock)
        if back is not None and self._state is not DockingState.APPROACH:
            phase = BackToStaging(back, self._params.staging, self._params.motion)
        self._tries += 0 if failure.elsewhere else 1
        self.tracker.forget()
        self._enter(Trigger.TRY_FAILED, phase)
        self._text = f"try {self._tries}: {failure.reason}"
        return None

    def _docked(self, view: View) -> Result:
        assert self._dock is not None
        problem = self._learn(self._dock) if self._dock.kind == "wheelchair" else ""
        self._phase = Latched("docked" + (f"; no correction stored: {problem}" if problem else ""))
        return self._result(DockCode.NONE, "", view)

    def _learn(self, dock: Dock) -> str:
        """Updates the dock's correction; returns why not, else an empty text."""
        p = self._params.latch
        before = self.corrections.get(self._dock_id, Correction())
        found = learnt(
            before,
            self.tracker.sightings,
            dock.dock_pose.pose(),
            p.learn_share,
            p.largest_correction_m,
            p.largest_correction_rad,
        )
        if not isinstance(found, Correction):
            return found
        self.corrections[self._dock_id] = found
        return ""

    # --- helpers -----------------------------------------------------------------------------------------------------

    def _watch_latch(self, situation: Situation) -> bool:
        """True if the latch has released a wheelchair that it should hold: the robot must stop for good."""
        may_open = self.undocking or (isinstance(self._phase, Latching) and self._phase.opening)
        lost = self._keeper.update(situation.latch, may_open=may_open)
        if lost:
            self._state, self._phase = DockingState.FAILED, _Idle(_LET_GO)
        elif not self.busy and self._state in (DockingState.IDLE, DockingState.FAILED):
            if self._station and not self._keeper.attached:
                self._enter(Trigger.ATTACHED, Latched(self._text))  # how the undocking ended
            elif self._keeper.holding and self._state is DockingState.IDLE:
                self._enter(Trigger.ATTACHED, Latched("docked"))
        return lost

    def _arrive_at_station(self) -> None:
        self._station, self._driven_off = self._dock_id, Pose2(0.0, 0.0, 0.0)

    def _watch_station(self, situation: Situation, dt_s: float) -> None:
        """A robot that was driven off by hand is clear of its station.

        By the twist: the frame of odometry may restart while the robot is docked.
        """
        p, twist = self._params.undock, situation.twist
        if not self._station or self.busy or twist is None or twist.speed() <= p.standing_mps:
            return
        self._driven_off = self._driven_off.compose(exp_se2(twist, dt_s))
        if math.hypot(self._driven_off.x, self._driven_off.y) < p.distance_m:
            return
        self._station = ""
        if not self._keeper.attached and self._state is DockingState.DOCKED:
            self._enter(Trigger.CLEAR, _Idle())

    def _view(self, situation: Situation, dt_s: float) -> View:
        dock_pose = None if self._undocking else self.tracker.dock_pose_in_odom()
        base = None
        if dock_pose is not None and situation.odom is not None:
            base = situation.odom.relative_to(dock_pose)
        return View(
            situation=situation,
            dt_s=dt_s,
            base=base,
            estimate=self.tracker.estimate,
            seen_ago_s=situation.now_s - self.tracker.seen_s,
            sightings=self.tracker.sightings,
            board=self.tracker.board(situation.now_s, self._params.servo.hold_after_s),
            moved=self.tracker.moved,
            approach_sign=1.0 if self._dock is None else _WAYS[self._dock.camera],
            docked_m=0.0 if self._dock is None else math.hypot(self._dock.dock_pose.x_m, self._dock.dock_pose.y_m),
            commanded=self._commanded,
        )

    def _resting_phase(self, text: str) -> Phase:
        """The phase after a job that has failed or was cancelled: with a closed contact the robot is docked."""
        near = self._state in (DockingState.FINE_ALIGN, DockingState.DOCKED) and not self._undocking
        if near and self._charging and self._dock is not None and self._dock.kind == "charger":
            self._arrive_at_station()
        return Latched(text) if self._keeper.attached else _Idle(text)

    def _enter(self, trigger: Trigger, phase: Phase) -> None:
        if isinstance(self._phase, Latching) and self._phase.may_hold:
            self._keeper.may_hold()
        self._state = target_of(self._state, trigger)
        self._phase = phase
        self.tracker.count_from(self._now_s)

    def _progress(self, position_error_m: float) -> float:
        """1 at the dock pose, 0 at staging and before."""
        if self._state is DockingState.DOCKED:
            return 1.0
        if not math.isfinite(position_error_m) or self._state not in SERVOED:
            return 0.0
        return max(0.0, 1.0 - position_error_m / self._params.staging.distance_m)

    def _result(self, code: Code, reason: str, view: View | None) -> Result:
        position_m, yaw_rad = _errors(None if view is None else view.base)
        return Result(code, reason, position_m, yaw_rad, self._tries, self._distance_m)
