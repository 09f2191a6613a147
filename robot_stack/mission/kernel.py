"""The mission manager's decisions: events and time in, effects out.

The order of effects is the rule about power loss: effects that start motion are journaled first (SaveRecord, SendGoal);
effects that stop it never wait for a disk (CancelGoal, SaveRecord), because an unfinished mission returns as PAUSED.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from enum import Enum

from robot_stack.contract.states import DOCKING, DockingState, HeldBy
from robot_stack.core.departure import SETTING_OUT, Departure, DepartureParams
from robot_stack.core.geometry import Pose2
from robot_stack.core.goals import NAVIGATION, NavigationGoals
from robot_stack.core.keepout import Keepout, keepout_problems
from robot_stack.core.mission import (
    Kind,
    Mission,
    Waypoint,
    aboard_at_start,
    docking_problem,
    ends_carriage,
    home_problem,
    never_dockable,
)
from robot_stack.core.safe_places import SafePlace, SafePlaces
from robot_stack.mission import display, docking, guards, orders, own_route, route, status
from robot_stack.mission import events as ev
from robot_stack.mission.docking import DockingCalls
from robot_stack.mission.events import (
    CancelDocking,
    CancelGoal,
    EditQueue,
    Effect,
    Event,
    Inputs,
    PublishEmergencyStop,
    ReportQueue,
    SaveRecord,
    WarnOfDeparture,
)
from robot_stack.mission.guards import finite
from robot_stack.mission.leg import Leg
from robot_stack.mission.orders import (
    Hold,
    Operation,
    Order,
    OrderState,
    Origin,
    QueueAnswer,
    QueueRefusal,
    QueueReport,
)
from robot_stack.mission.params import MissionParams
from robot_stack.mission.record import Record, restored
from robot_stack.mission.states import ACTIVE, AT_DOCK, STANDING, UNDER_WAY, State, Trigger, target_of

# A tick may be late by this much and count in full; more is a clock jump or a stopped process.
_LONGEST_STEP_S = 1.0
# An unknown command's name is shown to people, up to this length.
_LONGEST_NAME = 64
_BEGIN_DOCKING = {Kind.DOCK: Trigger.DOCK_HERE, Kind.UNDOCK: Trigger.UNDOCK_HERE}
_RESUME_DOCKING = {Kind.DOCK: Trigger.RESUME_DOCKING, Kind.UNDOCK: Trigger.RESUME_UNDOCKING}
_ENDED_AS = {
    State.COMPLETED: OrderState.COMPLETED,
    State.ABORTED: OrderState.ABORTED,
    State.FAILED: OrderState.FAILED,
}
_HELD_AFTER = {
    State.ABORTED: HeldBy.MISSION_ABORTED,
    State.FAILED: HeldBy.MISSION_FAILED,
    State.STOPPED: HeldBy.EMERGENCY_STOP,
}
_CRITICAL = "the battery is critical"
_LOST = "localization lost: check the pose on the map; RESUME goes on"
_LOST_NOW = "localization is lost: set the pose on the map first"
_NO_SERVER = f"waiting for {NAVIGATION}"
_EMERGENCY = "emergency stop is active: release it and reset the safety monitor first"
_CHARGES_ABOARD = "the battery charges with a wheelchair attached: drive clear of the charger by hand first"


class _Asker(Enum):
    """The source of a change that is undone if it cannot be journaled, except for STOP."""

    NONE = 0
    COMMAND = 1
    EDIT = 2  # of the queue
    ORDER = 3  # the start of the next order
    STOP = 4  # of the mission under way, by an edit of the queue


class MissionKernel:
    """State machine of one mission at a time, and of the orders that wait for it.

    params: tolerances and times. departure: of the warning before the robot sets out.
    record: the record from the journal; an active mission is restored as PAUSED.
    problem: error of the journal, shown as the reason in /mission/status.
    docks: kind of each dock by its id. safe_places: where it goes if the battery becomes critical; those in a keepout
    zone are not used. keepout: the site's zones, in which no waypoint may lie; None: no zones.
    """

    def __init__(
        self,
        params: MissionParams,
        departure: DepartureParams,
        record: Record | None = None,
        problem: str = "",
        docks: Mapping[str, str] | None = None,
        safe_places: SafePlaces | None = None,
        keepout: Keepout | None = None,
    ) -> None:
        self._params = params
        self._docks = docks or {}
        self._keepout = keepout
        places = safe_places.places if safe_places is not None else ()
        if keepout is not None:
            places = tuple(place for place in places if not keepout.zone_at(place.pose, chair=True))
        self._safe_places = SafePlaces(places=places)
        self._calls = DockingCalls(params)
        self._navigation = NavigationGoals(params.goal_retry_s)
        self._planned_s = 0.0  # for which navigation has had a plan while the robot should stand
        self._announcements = display.Announcements(params.announcement_s)
        self._record = restored(record or Record())
        self._before = self._record
        self._leg = self._leg_before = Leg(params)
        self._departure = Departure(departure)
        self._speed = route.MeanSpeed(params.eta_speed_time_constant_s)
        self._reporting = status.Reporting(1.0 / params.status_rate_hz)
        self._now_s = math.nan
        self._held = ""
        self._awake = False  # pose and safety have been known once
        self._journal_problem = problem
        self._unsaved = self._was_unsaved = False
        self._since_retry_s = 0.0
        self._answer = status.Answer()
        self._asker = _Asker.NONE
        self._hold = self._hold_before = Hold()
        # Not journaled: after a restart a pause has no owner.
        self._paused_by: Origin | None = None
        self._paused_by_before: Origin | None = None
        self._ended_s = 0.0  # since the last mission ended
        self._rested_s = 0.0  # since then, without anything else that moves the robot or keeps it
        self._lost_s = 0.0  # for which localization has been lost
        self._may_leave = False  # a person has released the queue of a robot that is charged and still docked
        self._reported_queue: QueueReport | None = None
        self.queue_answer = QueueAnswer()  # to the last EditQueue
        self._asserted = False  # our own last /emergency_stop is true
        self._saw_assertion = False

    @property
    def record(self) -> Record:
        return self._record

    @property
    def under_way(self) -> bool:
        """The robot rides or docks for a mission."""
        return self._record.state in UNDER_WAY

    def start_up(self, inputs: Inputs) -> tuple[Effect, ...]:
        """The effects at start-up: stop, journal the restored state, publish it."""
        report = (*self._report(inputs, 0.0, forced=True), *self._report_queue())
        paused = self._record.state is State.PAUSED
        if not paused and not self._journal_problem:
            return report
        # Navigation and docking may still execute goals of a mission manager that crashed.
        save = (SaveRecord(self._record),) if paused else ()
        return (CancelGoal(everything=True), CancelDocking(everything=True), *save, *report)

    def step(self, event: Event, inputs: Inputs, now_s: float) -> tuple[Effect, ...]:
        """The effects of ``event``, in order. ``now_s``: steady seconds; a jump either way is harmless."""
        dt_s = self._elapsed(now_s)
        self._departure.elapse(inputs.twist, dt_s)
        if not isinstance(event, ev.JournalFailed):
            commanded = _Asker.COMMAND if isinstance(event, ev.Command) else _Asker.NONE
            self._asker = _Asker.EDIT if isinstance(event, EditQueue) else commanded
        effects = self._react(event, inputs, dt_s)
        forced = isinstance(event, (ev.Command, ev.JournalFailed))
        warning = () if self._departure.remaining_s is None else (WarnOfDeparture(self._departure.remaining_s),)
        return (*effects, *warning, *self._report(inputs, dt_s, forced=forced), *self._report_queue())

    def _react(self, event: Event, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        match event:
            case ev.Command():
                return self._obey(event, inputs)
            case EditQueue():
                return self._edit(event, inputs)
            case ev.EmergencyStopBegan():
                self._hold.hold(HeldBy.EMERGENCY_STOP)
                return self._emergency_stop()
            case ev.PassengerChanged(attached):
                return self._passenger(attached)
            case ev.DockingAccepted() | ev.DockingFeedback() | ev.DockingEnded():
                self._calls.on_event(event)
                return ()
            case ev.JournalFailed(problem):
                return self._journal_failed(problem)
            case ev.Tick():
                return self._tick(inputs, dt_s)
            case _:
                self._navigation.on_event(event)
                return ()

    # --- commands ----------------------------------------------------------------------------------------------------

    def _obey(self, command: ev.Command, inputs: Inputs) -> tuple[Effect, ...]:
        self._answer = status.Answer(command.name[:_LONGEST_NAME])
        match command.name:
            case ev.START_MISSION:
                return self._start(command, inputs)
            case ev.PAUSE:
                return self._pause()
            case ev.RESUME:
                return self._resume(inputs)
            case ev.ABORT:
                return self._abort()
            case ev.EMERGENCY_STOP:
                self._asserted, self._saw_assertion = True, False
                return (PublishEmergencyStop(True), *self._emergency_stop())
            case _:
                return self._refuse(f"unknown command; known: {', '.join(ev.COMMANDS)}")

    def _start(self, command: ev.Command, inputs: Inputs) -> tuple[Effect, ...]:
        if command.mission is None:
            return self._refuse(command.problem)
        if target_of(self._record.state, Trigger.START) is None:
            return self._queue_up(command.mission)
        problem = self._may_not_start(command.mission, inputs) or self._too_low_for(command.mission, inputs)
        if problem:
            return self._refuse(problem)
        return self._begin(Trigger.START, command.mission, inputs)

    def _queue_up(self, mission: Mission) -> tuple[Effect, ...]:
        """START_MISSION during a mission. A second touch of the same button is not a second ride."""
        running = self._record.mission.id if self._record.mission else ""
        touched = [order.mission_id for order in self._record.queue.orders if order.origin is Origin.UI_COMMAND]
        if mission.id == running:
            return self._refuse(f"mission {running!r} is {self._record.state.value}; ABORT it first")
        if mission.id in touched:
            return self._refuse(f"mission {mission.id!r} is in the queue already")
        if len(touched) >= orders.MAX_UI_COMMANDS:
            return self._refuse(f"{len(touched)} missions wait already; staff can add more to the queue")
        try:
            queue, order = self._record.queue.named(mission)
            return self._save_queue(queue.added(order))
        except QueueRefusal as refusal:
            return self._refuse(str(refusal))

    def _may_not_start(self, mission: Mission, inputs: Inputs) -> str:
        aboard = self._record.passenger_attached
        undockable = docking_problem(mission, self._docks, aboard)
        if undockable:
            return undockable[1]
        return home_problem(mission, self._docks) or self._closed(mission, aboard) or self._may_not_go(inputs)

    def _closed(self, mission: Mission, aboard: bool) -> str:
        """Why a keepout zone excludes the route, else an empty text. aboard: a passenger, at the start."""
        if self._keepout is None:
            return ""
        return next((text for _, text in keepout_problems(mission, self._docks, self._keepout, aboard)), "")

    def _begin(
        self, trigger: Trigger, mission: Mission, inputs: Inputs, order: Order | None = None
    ) -> tuple[Effect, ...]:
        record = self._record
        queue = record.queue if order is None else record.queue.begun(order)
        aboard, start = record.passenger_attached, finite(inputs.pose)
        self._speed = route.MeanSpeed(self._params.eta_speed_time_constant_s)
        fresh = Record(record.state, mission, passenger_attached=aboard, start=start, queue=queue)
        if self._at_charger(inputs):
            return self._begin_docking(Trigger.START_DOCKED, replace(fresh, leaving=True))
        return self._go(trigger, fresh)

    def _pause(self) -> tuple[Effect, ...]:
        reason = "paused by command; RESUME goes on"
        if self._paused_by is None:
            return self._stand(Trigger.PAUSE, reason)
        # The robot stands already: the pause becomes that of a person.
        self._paused_by, self._record = None, replace(self._record, reason=reason)
        return ()

    def _resume(self, inputs: Inputs) -> tuple[Effect, ...]:
        if target_of(self._record.state, Trigger.RESUME) is None:
            return self._refuse(f"RESUME needs a paused mission, the state is {self._record.state.value}")
        problem = self._may_not_go(inputs) or self._may_not_resume(inputs)
        return self._refuse(problem) if problem else self._resumed(inputs)

    def _resumed(self, inputs: Inputs) -> tuple[Effect, ...]:
        if self._leaves_charger(inputs):
            record = replace(self._record, failed_tries=0, safe_place=None, leaving=True)
            return self._begin_docking(Trigger.RESUME_UNDOCKING, record)
        if self._record.leaving:
            return self._go(Trigger.RESUME, replace(self._record, leaving=False, docking_begun=False))
        if self._record.safe_place is not None:
            place = self._record.safe_place if guards.battery_critical(inputs) else None
            if place is not None and place.dock and self._record.passenger_attached:
                place = None
            reason = self._record.reason if place else ""
            record = replace(self._record, failed_tries=0, safe_place=place, docking_begun=False)
            if record.current is not None:
                return self._go(Trigger.RESUME, record, reason)
            return self._end(record, Trigger.RESUME_DONE, Trigger.RESUME_AWAITING)
        if self._record.current is None:
            return self._end(self._record, Trigger.RESUME_DONE, Trigger.RESUME_AWAITING)
        task = docking.task_of(self._record, self._docks) if self._record.docking_begun else None
        if task is None:
            return self._go(Trigger.RESUME, replace(self._record, failed_tries=0))
        if task.fulfilled(self._record.passenger_attached):
            return self._next(inputs, Trigger.RESUME, Trigger.RESUME_DONE, Trigger.RESUME_AWAITING)
        return self._begin_docking(_RESUME_DOCKING[task.kind])

    def _may_not_resume(self, inputs: Inputs) -> str:
        if self._leaves_charger(inputs):
            return self._battery_low(inputs)
        if self._record.docking_begun and self._record.safe_place is None:
            task = docking.task_of(self._record, self._docks)
            return guards.not_latched(inputs) if task is not None and task.kind is Kind.DOCK else ""
        if guards.lost(inputs):
            return _LOST_NOW
        if guards.battery_critical(inputs) and self._record.safe_place is None:
            return f"{_CRITICAL}: charge the robot first"
        return ""

    def _leaves_charger(self, inputs: Inputs) -> bool:
        """The robot is docked, but not for a waypoint of its mission: it must undock before it goes on."""
        record = self._record
        due = record.leaving or not (record.docking_begun or docking.at_station(record, self._docks))
        return self._at_charger(inputs) and record.current is not None and (due or record.safe_place is not None)

    def _abort(self, trigger: Trigger = Trigger.ABORT, by: str = "command") -> tuple[Effect, ...]:
        aboard = self._record.passenger_attached
        note = "; the passenger stays attached until an operator decides" if aboard else ""
        return self._stand(trigger, f"aborted by {by}{note}")

    def _refuse(self, why: str) -> tuple[Effect, ...]:
        self._answer = replace(self._answer, refusal=f"{self._answer.command} refused: {why}")
        return ()

    def _may_not_go(self, inputs: Inputs) -> str:
        if self._in_emergency(inputs):
            return _EMERGENCY
        return _CHARGES_ABOARD if self._charges(inputs) and self._record.passenger_attached else ""

    def _battery_low(self, inputs: Inputs) -> str:
        return guards.battery_low(inputs, self._params.minimum_battery)

    def _too_low_for(self, mission: Mission, inputs: Inputs) -> str:
        """With a low battery only a passenger is driven to where the carriage ends, and not with a critical one."""
        low = self._battery_low(inputs)
        if not low or not self._record.passenger_attached or guards.battery_critical(inputs):
            return low
        ends = ends_carriage(mission, self._docks)
        return "" if ends else f"{low}, except one that undocks the passenger aboard"

    # --- changes of state --------------------------------------------------------------------------------------------

    def _go(self, trigger: Trigger, record: Record, reason: str = "") -> tuple[Effect, ...]:
        """Continues to the record's waypoint: journaled first, then the robot starts, after a warning if it is due."""
        undocks = docking.undocks_in_place(record, self._docks)
        save = self._change(trigger, record, reason, goal_due=self._departure.due or undocks)
        current = self._record.current
        assert current is not None
        return (save,) if self._leg.goal_due else (save, self._navigation.send(current.pose, current.limit))

    def _stand(self, trigger: Trigger, reason: str, record: Record | None = None) -> tuple[Effect, ...]:
        """Enters a standing state; a command that is not valid in the present state is refused."""
        if target_of(self._record.state, trigger) is None:
            return self._refuse(f"no mission to {trigger.value.lower()}, the state is {self._record.state.value}")
        stop = (CancelGoal(everything=True), *self._calls.drop())
        return (*stop, self._change(trigger, record or self._record, reason))

    def _begin_docking(self, trigger: Trigger, record: Record | None = None) -> tuple[Effect, ...]:
        """Journaled first; a later tick sends the goal. Only the docking controller commands the drive meanwhile."""
        save = self._change(trigger, replace(record or self._record, docking_begun=True), "")
        self._calls.begin()
        task = docking.task_of(self._record, self._docks)
        assert task is not None
        self._announcements.say(*display.announced_at_begin_of(task))
        return (CancelGoal(), save)

    def _change(self, trigger: Trigger, record: Record, reason: str, *, goal_due: bool = False) -> SaveRecord:
        target = target_of(self._record.state, trigger)
        assert target is not None, f"{trigger} in {self._record.state}"
        self._before, self._hold_before = self._record, copy(self._hold)
        self._record = replace(record, state=target, reason=reason, queue=self._queue_in(trigger, target, record))
        self._paused_by_before, self._paused_by = self._paused_by, None
        self._leg_before, self._leg = self._leg, Leg(self._params, goal_due=goal_due)
        self._departure.drop()
        self._held = ""
        return self._save()

    def _save(self) -> SaveRecord:
        # Assumed to work until a JournalFailed event.
        self._was_unsaved = self._unsaved
        self._unsaved, self._journal_problem, self._since_retry_s = False, "", 0.0
        return SaveRecord(self._record)

    # --- orders ------------------------------------------------------------------------------------------------------

    def _edit(self, request: EditQueue, inputs: Inputs) -> tuple[Effect, ...]:
        try:
            return self._edited(request, inputs)
        except QueueRefusal as refusal:
            self.queue_answer = QueueAnswer(False, str(refusal))
            return ()

    def _edited(self, request: EditQueue, inputs: Inputs) -> tuple[Effect, ...]:
        queue = self._record.queue
        match request.operation:
            case None:
                raise QueueRefusal(request.problem)
            case Operation.ADD | Operation.REPLACE:
                if request.order is None:
                    raise QueueRefusal(request.problem)
                self._check_own_route(request.order)
                known = queue.checked(request.order)
                if known is not None and (request.operation is Operation.ADD or known.state is not OrderState.QUEUED):
                    return self._answer_known(request.operation, known)
                if request.operation is Operation.REPLACE:
                    # The route of a waiting order may have been extended.
                    order = known if known is not None and known.route else request.order
                    return self._replace_mission(order, inputs)
                queue = queue.added(request.order)
                self._answer_edit(f"order {request.order.id!r} waits at place {queue.orders.index(request.order) + 1}")
                return self._save_queue(queue)
            case Operation.REMOVE:
                queue = queue.removed(request.order_id)
                self._answer_edit(f"order {request.order_id!r} is removed")
                return self._save_queue(queue)
            case Operation.MOVE:
                queue = queue.moved(request.order_id, request.steps)
                place = [order.id for order in queue.orders].index(request.order_id) + 1
                self._answer_edit(f"order {request.order_id!r} waits at place {place}")
                return self._save_queue(queue)
            case Operation.HOLD:
                self._hold.hold(HeldBy.STAFF)
                return self._answer_edit(self._hold.reason)
            case Operation.RELEASE:
                charged = self._at_dock(inputs) and inputs.battery >= self._params.charged
                docked = "" if charged else self._docked(inputs)
                lost = _LOST_NOW if guards.lost(inputs) else ""
                problem = self._may_not_go(inputs) or self._battery_low(inputs) or docked or lost
                if request.origin is Origin.FLEET:
                    problem = "only a person releases the queue"
                if problem:
                    raise QueueRefusal(problem)
                self._may_leave = charged
                self._hold.release()
                return self._answer_edit("orders start one after the other")
            case _:
                return self._edited_by_origin(request, inputs)

    def _answer_known(self, operation: Operation, known: Order) -> tuple[Effect, ...]:
        text = f"the order {known.id!r} is known, it is {known.state.name}"
        wanted = known.state in (OrderState.QUEUED, OrderState.UNDER_WAY, OrderState.COMPLETED)
        if not wanted or (operation is Operation.REPLACE and known.state is not OrderState.UNDER_WAY):
            raise QueueRefusal(text)
        return self._answer_edit(text)

    def _answer_edit(self, message: str) -> tuple[Effect, ...]:
        self.queue_answer = QueueAnswer(True, message)
        return ()

    def _save_queue(self, queue: orders.OrderQueue) -> tuple[Effect, ...]:
        return self._save_record(replace(self._record, queue=queue))

    def _save_record(self, record: Record) -> tuple[Effect, ...]:
        """Without a change of the state."""
        self._before, self._leg_before = self._record, self._leg
        self._record = record
        return (self._save(),)

    def _check_own_route(self, order: Order) -> None:
        """Raises QueueRefusal for a route that cannot be driven; a mission file is checked at its start."""
        if not order.route or order.mission is None:
            return
        undockable = never_dockable(order.mission, self._docks)
        if undockable is not None:
            raise QueueRefusal(undockable[1])
        closed = self._closed(order.mission, aboard_at_start(order.mission, False))
        if closed:
            raise QueueRefusal(closed)

    def _edited_by_origin(self, request: EditQueue, inputs: Inputs) -> tuple[Effect, ...]:
        """A change of an order by its giver."""
        if request.problem:
            raise QueueRefusal(request.problem)
        order = self._record.queue.owned(request.order_id, request.origin)
        if request.operation is Operation.EXTEND:
            return self._extend(order, request, inputs)
        if request.operation is Operation.CANCEL and order.state is OrderState.QUEUED:
            self._answer_edit(f"order {order.id!r} is removed")
            return self._save_queue(self._record.queue.removed(order.id))
        if request.operation is Operation.CANCEL and order.state in (OrderState.REMOVED, OrderState.ABORTED):
            return self._answer_edit(f"the order {order.id!r} is {order.state.name}")
        if order.state is not OrderState.UNDER_WAY:
            raise QueueRefusal(f"the order {order.id!r} is {order.state.name}")
        if request.operation is Operation.RESUME:
            return self._resume_order(order, inputs)
        if self.under_way and self._record.safe_place is not None:
            raise QueueRefusal(f"{_CRITICAL}: the robot drives to {self._record.safe_place} first")
        return self._pause_order(order) if request.operation is Operation.PAUSE else self._cancel_order(order)

    def _extend(self, order: Order, request: EditQueue, inputs: Inputs) -> tuple[Effect, ...]:
        mission = self._record.mission if order.state is OrderState.UNDER_WAY else order.mission
        if mission is None:
            raise QueueRefusal(f"the order {order.id!r} is {order.state.name}")
        changed, longer = own_route.with_part(order, mission, request.first, request.part, more_follows=request.open)
        self._answer_edit(f"the route of order {order.id!r} has {len(longer.waypoints)} waypoints")
        if changed is order and longer is mission:
            return ()
        if order.state is OrderState.QUEUED:
            changed = replace(changed, mission=longer)
            self._check_own_route(changed)
            return self._save_queue(self._record.queue.with_changed(changed))
        aboard = aboard_at_start(mission, self._record.passenger_attached)
        undockable = docking_problem(longer, self._docks, aboard)
        problem = undockable[1] if undockable is not None else self._closed(longer, aboard)
        if problem:
            raise QueueRefusal(problem)
        queue = self._record.queue.with_changed(changed)
        return self._go_further(replace(self._record, mission=longer, queue=queue), inputs)

    def _go_further(self, record: Record, inputs: Inputs) -> tuple[Effect, ...]:
        """Goes on with the extended route of the mission under way, or ends it, if it waits for that."""
        if not self._awaits_part:
            return self._save_record(record)
        if self._may_not_go(inputs):
            raise QueueRefusal(self._may_not_go(inputs))
        if record.current is not None:
            return self._go(Trigger.EXTENDED, record)
        return self._end(record, Trigger.DONE, Trigger.AWAIT_PART)

    @property
    def _awaits_part(self) -> bool:
        """The robot stands at the end of an open route."""
        return self._record.state is State.WAITING and self._record.current is None

    def _pause_order(self, order: Order) -> tuple[Effect, ...]:
        state = self._record.state
        if self._paused_by is order.origin:
            return self._answer_edit(f"order {order.id!r} is paused")
        if target_of(state, Trigger.PAUSE) is None:
            raise QueueRefusal(f"the mission is {state.value} already, only a person resumes it")
        self._asker = _Asker.STOP
        self._answer_edit(f"order {order.id!r} is paused")
        effects = self._stand(Trigger.PAUSE, f"paused by {order.origin.text}; RESUME goes on")
        self._paused_by = order.origin
        return effects

    def _resume_order(self, order: Order, inputs: Inputs) -> tuple[Effect, ...]:
        if self.under_way:
            return self._answer_edit(f"order {order.id!r} is under way")
        if self._paused_by is not order.origin:
            raise QueueRefusal(f"only a person resumes this mission: {self._record.reason}")
        problem = self._may_not_go(inputs) or self._may_not_resume(inputs)
        if problem:
            raise QueueRefusal(problem)
        self._answer_edit(f"order {order.id!r} is under way")
        return self._resumed(inputs)

    def _cancel_order(self, order: Order) -> tuple[Effect, ...]:
        record = self._record
        # Where a person was needed, or the robot may stand at a wheelchair, no order starts by itself.
        look = record.docking_begun or (record.state in STANDING and self._paused_by is not order.origin)
        self._asker = _Asker.STOP
        self._answer_edit(f"order {order.id!r} is aborted")
        effects = self._abort(Trigger.CANCEL, order.origin.text)
        if look:
            where = "while docking" if record.docking_begun else "in a pause that a person ends"
            self._hold.hold(HeldBy.MISSION_ABORTED, f"the mission before was aborted by {order.origin.text} {where}")
        return effects

    def _replace_mission(self, order: Order, inputs: Inputs) -> tuple[Effect, ...]:
        """Changes the destination of the ride: the order's mission in place of the present one."""
        record = self._record
        if target_of(record.state, Trigger.REPLACE) is None or record.docking_begun:
            raise QueueRefusal(f"no change of destination while the mission is {record.state.value}")
        if order.origin is Origin.FLEET and (record.state is State.PAUSED or record.passenger_attached):
            raise QueueRefusal("the fleet changes neither a paused ride nor that of a passenger")
        if docking.at_station(record, self._docks) or self._at_charger(inputs):
            raise QueueRefusal("no change of destination while the robot is docked to a station or charges")
        assert order.mission is not None
        problem = self._may_not_start(order.mission, inputs) or self._may_not_resume(inputs)
        if guards.battery_critical(inputs):
            problem = f"{_CRITICAL}: charge the robot first"
        if problem:
            raise QueueRefusal(problem)
        self._answer_edit(f"order {order.id!r} is under way")
        return self._begin(Trigger.REPLACE, order.mission, inputs, order)

    def _queue_in(self, trigger: Trigger, target: State, record: Record) -> orders.OrderQueue:
        """The queue in a new state of the mission; holds it where a person has to look first."""
        held = None if trigger is Trigger.CANCEL else _HELD_AFTER.get(target)
        if (target is State.COMPLETED or trigger is Trigger.CANCEL) and record.passenger_attached:
            held = HeldBy.PASSENGER
        if held is not None:
            self._hold.hold(held)
        ended = _ENDED_AS.get(target)
        self._ended_s = self._rested_s = 0.0
        return record.queue.finished(ended) if ended is not None else record.queue

    def _watch_queue(self, inputs: Inputs) -> None:
        """A queue that is held here needs no journal: a restart holds it too."""
        if self._in_emergency(inputs):
            self._hold.hold(HeldBy.EMERGENCY_STOP)
        if self._battery_low(inputs):
            self._hold.hold(HeldBy.BATTERY_LOW)
        if inputs.manual and not self.under_way:
            self._hold.hold(HeldBy.MANUAL)
        self._may_leave = self._may_leave and self._at_dock(inputs)
        if self._record.state in ACTIVE:
            return
        if self._lost_s >= self._params.localization_lost_s:
            self._hold.hold(HeldBy.LOCALIZATION_LOST)
        if self._docked(inputs) and not self._may_leave:
            self._hold.hold(HeldBy.DOCKED)
        # The plan of the mission that has just ended may still be there.
        if self._ended_s > self._params.goal_retry_s and (inputs.planned or inputs.docking_state in DOCKING):
            self._hold.hold(HeldBy.MANUAL, "another client drives or docks the robot")

    def _docked(self, inputs: Inputs) -> str:
        """Why the robot may not drive off by itself: it is at a station, or at a chair that is not latched."""
        return orders.HELD_TEXTS[HeldBy.DOCKED] if self._at_dock(inputs) or inputs.charging else ""

    def _at_dock(self, inputs: Inputs) -> bool:
        return inputs.docking_state == DockingState.DOCKED and not self._record.passenger_attached

    def _at_charger(self, inputs: Inputs) -> bool:
        """As ``_at_dock``, also while the docking controller starts, if the battery charges."""
        return self._at_dock(inputs) or (self._charges(inputs) and not self._record.passenger_attached)

    def _charges(self, inputs: Inputs) -> bool:
        """At a charger or cable. A braking drive charges too, for a moment; a full battery shows no charger."""
        return inputs.charging and self._departure.due

    def _next_order(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        """Starts the next order of a robot that has no mission, unless a person or the safety has to be waited for."""
        busy = guards.held_in_ride(inputs) or inputs.planned or inputs.setting_out or not inputs.navigation_served
        self._ended_s += dt_s
        self._rested_s = 0.0 if busy or self._unsaved else self._rested_s + dt_s
        order = self._record.queue.due(inputs.clock_s)
        if order is None or self._hold.by is not HeldBy.NOTHING or self._rested_s < self._params.next_order_after_s:
            return ()
        assert order.mission is not None
        if order.origin is Origin.FLEET and self._record.passenger_attached:
            self._hold.hold(HeldBy.PASSENGER)
            return ()
        problem = self._may_not_start(order.mission, inputs)
        if problem:
            self._hold.hold(HeldBy.MISSION_FAILED, f"order {order.id!r} cannot start: {problem}")
            return ()
        self._asker = _Asker.ORDER
        return self._begin(Trigger.START, order.mission, inputs, order)

    def _report_queue(self) -> tuple[Effect, ...]:
        report = QueueReport(self._record.queue, self._hold.by, self._hold.reason, self._paused_by)
        if report == self._reported_queue:
            return ()
        self._reported_queue = report
        return (ReportQueue(report),)

    # --- events ------------------------------------------------------------------------------------------------------

    def _emergency_stop(self) -> tuple[Effect, ...]:
        if target_of(self._record.state, Trigger.EMERGENCY_STOP) is None:
            return ()
        reason = "emergency stop; once it is released and reset, RESUME goes on"
        return self._stand(Trigger.EMERGENCY_STOP, reason)

    def _passenger(self, attached: bool) -> tuple[Effect, ...]:
        if attached == self._record.passenger_attached:
            return ()
        self._record = replace(self._record, passenger_attached=attached)
        self._paused_by = None
        if attached and self._record.state not in ACTIVE:
            self._hold.hold(HeldBy.PASSENGER)
        current = self._record.queue.current
        ordered = current is not None and current.origin is Origin.FLEET
        stands = self._record.state is State.WAITING or (self._record.state is State.RUNNING and self._leg.goal_due)
        # A wheelchair that latches just then must not be undocked as if the robot were at a charger.
        leaves = self._record.leaving and self._record.state is State.UNDOCKING
        if attached and (leaves or (ordered and stands)):
            return self._stand(Trigger.PAUSE, "a passenger came aboard before the start; RESUME goes on")
        if not attached and self._record.state in (State.RUNNING, State.WAITING):
            return self._stand(Trigger.PAUSE, "the passenger was undocked during the ride; RESUME goes on without")
        return (self._save(),)

    def _journal_failed(self, problem: str) -> tuple[Effect, ...]:
        why = f"the journal cannot be written: {problem}"
        self._reported_queue = None  # the report was dropped with the effects after the save
        if self._asker is _Asker.EDIT or (self._asker is not _Asker.NONE and self._moves_or_queues()):
            # Nothing has moved yet, because saving came first: the request is undone.
            if self._leg_before is not self._leg:  # its goal was cancelled in the kernel's view only
                self._leg, self._hold, self._paused_by = self._leg_before, self._hold_before, self._paused_by_before
                self._leg.goal_due = self._before.state is State.RUNNING
            self._record = replace(self._before, passenger_attached=self._record.passenger_attached)
            self._unsaved = self._was_unsaved
            if self._unsaved:
                self._journal_problem = why
            return self._undone(why)
        effects: tuple[Effect, ...] = ()
        if self._record.state in UNDER_WAY:
            self._change(Trigger.JOURNAL_LOST, self._record, "paused; RESUME goes on once the journal can be written")
            effects = (CancelGoal(everything=True), *self._calls.drop())
        self._unsaved, self._journal_problem, self._paused_by = True, why, None
        if self._asker is _Asker.STOP:
            self.queue_answer = QueueAnswer(True, f"{self.queue_answer.message}; {why}")
        return effects

    def _moves_or_queues(self) -> bool:
        """The request that was not journaled lets the robot go, or only queues an order."""
        return self.under_way or self._before.state is self._record.state

    def _undone(self, why: str) -> tuple[Effect, ...]:
        match self._asker:
            case _Asker.EDIT:
                self.queue_answer = QueueAnswer(False, why)
                return () if self.under_way else self._calls.drop()
            case _Asker.ORDER:
                self._hold.hold(HeldBy.JOURNAL, why)
                return self._calls.drop()
            case _:
                return (*self._refuse(why), *self._calls.drop())

    # --- time --------------------------------------------------------------------------------------------------------

    def _tick(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        released = self._release_own_stop(inputs)
        self._announcements.elapse(dt_s)
        if self._departure.moving:
            self._announcements.say()  # from now on it is worth more to show that the robot drives
        self._lost_s = self._lost_s + dt_s if guards.lost(inputs) else 0.0
        self._watch_queue(inputs)
        if guards.needs_a_person(inputs):
            self._paused_by = None
        if self._in_emergency(inputs) and target_of(self._record.state, Trigger.EMERGENCY_STOP):
            return (*released, *self._emergency_stop())
        if self._record.state in AT_DOCK:
            return (*released, *self._dock(inputs, dt_s))
        released = (*released, *self._calls.idle(inputs, dt_s))
        if self._record.state is State.RUNNING:
            return (*released, *self._drive(inputs, dt_s))
        if self._record.state is State.WAITING:
            return (*released, *self._wait(inputs, dt_s))
        return (*released, *self._rest(inputs, dt_s), *self._retry_journal(dt_s))

    def _drive(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        pose, current = finite(inputs.pose), self._record.current
        assert current is not None
        self._held = guards.held_in_ride(inputs) or inputs.door
        if self._lost_s >= self._params.localization_lost_s:
            return self._stand(Trigger.LOST, _LOST)
        if guards.battery_critical(inputs) and self._record.safe_place is None:
            return self._to_safety(inputs)
        if docking.undocks_in_place(self._record, self._docks):
            return self._serve(inputs)
        if self._leg.goal_due:
            return self._set_out(current, inputs, dt_s)
        self._leg.at_door = bool(inputs.door) or (self._leg.at_door and not self._departure.moving)
        if self._departure.due and not self._leg.at_door:  # at a door navigation keeps its request and warns itself
            # Navigation would continue by itself: it gets its goal back after a warning.
            self._leg.goal_due = True
            return (CancelGoal(),)
        if pose is not None:
            self._note_motion(pose, inputs, dt_s)
            if self._leg.arrived(inputs, self._record.stops, self._record.waypoint, dt_s):
                return self._serve(inputs)
            if not self._held and self._stalls(pose, current.pose, dt_s):
                return self._try_failed(pose, self._navigation.problem or inputs.navigation_text)
        if not self._navigation.due_again(dt_s):
            return ()
        if not inputs.navigation_served:
            self._held = _NO_SERVER
            return ()
        self._leg.goal_due = True
        return self._set_out(current, inputs, dt_s)

    def _stalls(self, pose: Pose2, goal: Pose2, dt_s: float) -> bool:
        return self._leg.stalls(pose, goal, self._navigation.distance_m, self._navigation.recoveries, dt_s)

    def _to_safety(self, inputs: Inputs) -> tuple[Effect, ...]:
        """The battery is critical: drives to the nearest safe place or charger, or stands where the robot is."""
        if docking.at_station(self._record, self._docks):
            return self._stand(Trigger.NO_SAFE_PLACE, f"{_CRITICAL}; the robot stays at the station, RESUME goes on")
        pose = finite(inputs.pose)
        if pose is None:
            return ()
        place = self._refuge(pose)
        if place is None:
            reason = f"{_CRITICAL} and no safe place is configured; charge the robot, then RESUME goes on"
            return self._stand(Trigger.NO_SAFE_PLACE, reason)
        record = replace(self._record, safe_place=place, failed_tries=0)
        return self._go(Trigger.TO_SAFE_PLACE, record, f"{_CRITICAL}: driving to {place}")

    def _refuge(self, pose: Pose2) -> SafePlace | None:
        """The nearest safe place, or for an empty robot the charger of the mission's home if that is not farther."""
        place = self._safe_places.nearest(pose)
        assert self._record.mission is not None
        home = self._record.mission.home
        if not home.dock or self._record.passenger_attached:
            return place
        nearer = place is not None and pose.distance_to(place.pose) < pose.distance_to(home.pose)
        return place if nearer else SafePlace(x=home.x, y=home.y, yaw=home.yaw, dock=home.dock, name=home.dock)

    def _set_out(self, goal: Waypoint, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        if self._held:  # a warning long before the motion has no effect
            self._departure.drop()
            return ()
        if not inputs.navigation_served:
            self._departure.drop()
            self._held = _NO_SERVER
            assert inputs.pose is not None
            stalls = self._leg.stalls(inputs.pose, goal.pose, math.nan, 0, dt_s)
            return self._try_failed(inputs.pose, f"no {NAVIGATION}") if stalls else ()
        if not self._departure.cleared(dt_s):
            self._held = SETTING_OUT
            return ()
        self._leg.goal_due = False
        return (self._navigation.send(goal.pose, goal.limit),)

    def _note_motion(self, pose: Pose2, inputs: Inputs, dt_s: float) -> None:
        if self._record.start is None:
            self._record = replace(self._record, start=pose)
        twist = inputs.twist
        if twist is not None and twist.is_finite() and twist.speed() > self._params.standstill_speed_mps:
            self._speed.update(twist.speed(), dt_s)

    def _serve(self, inputs: Inputs) -> tuple[Effect, ...]:
        """The waypoint is reached."""
        current, place = self._record.current, self._record.safe_place
        assert current is not None
        if place is not None and not place.dock:
            reason = f"{_CRITICAL}: at {place}; charge the robot, then RESUME goes on"
            return self._stand(Trigger.SAFE_PLACE, reason, replace(self._record, safe_place=None))
        if current.action.wait_s > 0.0:
            return (self._change(Trigger.WAIT_HERE, self._record, ""),)
        begin = _BEGIN_DOCKING.get(current.action.kind)
        return self._begin_docking(begin) if begin else self._next(inputs)

    def _dock(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        task = docking.task_of(self._record, self._docks)
        assert task is not None
        held = guards.held_by(inputs, undocks=task.kind is Kind.UNDOCK)
        attached = self._record.passenger_attached
        if held or not self._calls.about_to_start(inputs):
            self._departure.drop()
        elif not self._departure.cleared(dt_s):
            held = SETTING_OUT
        effects, outcome = self._calls.tick(task, inputs, attached, held, dt_s)
        self._held = self._calls.text
        if outcome is None:
            return effects
        if outcome.problem:
            return (*effects, *self._stand(Trigger.DOCKING_FAILED, outcome.problem))
        self._announcements.say(*display.announced_at_end_of(task, self._calls.state))
        self._calls.drop()
        place = self._record.safe_place
        if self._record.leaving:
            return self._go(Trigger.NEXT, replace(self._record, leaving=False, docking_begun=False))
        if place is None or self._record.homeward:
            return self._next(inputs)
        reason = f"{_CRITICAL}: at {place}; once it is charged, RESUME goes on"
        return self._stand(Trigger.SAFE_PLACE, reason, replace(self._record, safe_place=None, docking_begun=False))

    def _wait(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        current = self._record.current
        if current is None and inputs.manual:
            return self._stand(Trigger.PAUSE, "driven by hand in the wait for the next part; RESUME goes on")
        if guards.battery_critical(inputs):
            return self._to_safety(inputs)
        if current is None:
            return self._stand(Trigger.LOST, _LOST) if self._lost_s >= self._params.localization_lost_s else ()
        self._leg.waited_s += dt_s
        return self._next(inputs) if self._leg.waited_s >= current.action.wait_s else ()

    def _next(
        self,
        inputs: Inputs,
        onward: Trigger = Trigger.NEXT,
        done: Trigger = Trigger.DONE,
        await_part: Trigger = Trigger.AWAIT_PART,
    ) -> tuple[Effect, ...]:
        waypoint = self._record.waypoint + 1
        record = replace(self._record, waypoint=waypoint, failed_tries=0, docking_begun=False, safe_place=None)
        if record.current is None and self._should_go_home(inputs):
            record = replace(record, homeward=True)
        if record.current is not None:
            return self._go(onward, record)
        return self._end(record, done, await_part)

    def _end(self, record: Record, done: Trigger, await_part: Trigger) -> tuple[Effect, ...]:
        """At the end of the route: the mission is done, or waits for the next part."""
        order = record.queue.current
        if order is None or not order.open:
            return self._stand(done, "", record)
        reason = f"waiting for the next part of the route from {order.origin.text}"
        return (CancelGoal(), self._change(await_part, replace(record, failed_tries=0), reason))

    def _should_go_home(self, inputs: Inputs) -> bool:
        record = self._record
        if record.mission is None or record.homeward or record.passenger_attached or not self._battery_low(inputs):
            return False
        last = record.mission.waypoints[-1]
        if last.action.kind is Kind.DOCK:  # a robot at a station stays there
            return False
        home = record.mission.home
        return bool(home.dock) or last.pose.distance_to(home.pose) > self._params.home_radius_m

    def _try_failed(self, pose: Pose2, navigation_text: str) -> tuple[Effect, ...]:
        current = self._record.current
        assert current is not None
        failed = self._record.failed_tries + 1
        record = replace(self._record, failed_tries=failed)
        left = f"{pose.distance_to(current.pose):.2f} m before waypoint {current.name!r}"
        timeout_s, tries = self._params.progress_timeout_s, self._params.tries
        reason = f"no progress for {timeout_s:.0f} s, {left}, try {failed} of {tries}"
        if navigation_text:
            reason += f"; navigation: {navigation_text}"
        if failed >= self._params.tries and record.safe_place is not None:
            reason = f"{_CRITICAL}; {reason}; charge the robot, then RESUME goes on"
            return self._stand(Trigger.NO_SAFE_PLACE, reason, replace(record, safe_place=None, failed_tries=0))
        if failed >= self._params.tries:
            return self._stand(Trigger.GAVE_UP, reason, record)
        # The goal is cancelled first and sent again a tick later, so that navigation replans.
        return (CancelGoal(), self._change(Trigger.TRY_FAILED, record, reason, goal_due=True))

    def _rest(self, inputs: Inputs, dt_s: float) -> tuple[Effect, ...]:
        """In PAUSED and STOPPED the robot does not drive: a goal that navigation still has is cancelled again."""
        if self._record.state not in ACTIVE:
            return self._next_order(inputs, dt_s)
        self._planned_s = self._planned_s + dt_s if inputs.planned else 0.0
        if self._planned_s < self._params.goal_retry_s:
            return ()
        self._planned_s = 0.0
        return (CancelGoal(everything=True),)

    def _retry_journal(self, dt_s: float) -> tuple[Effect, ...]:
        self._since_retry_s += dt_s
        if not self._unsaved or self._since_retry_s < 1.0 / self._params.status_rate_hz:
            return ()
        return (self._save(),)

    def _release_own_stop(self, inputs: Inputs) -> tuple[Effect, ...]:
        """Once both keys have released the stop, our own latched ``true`` must not reach a node that starts later."""
        if not self._asserted:
            return ()
        self._saw_assertion = self._saw_assertion or inputs.emergency_stop
        if inputs.emergency_stop or not self._saw_assertion:
            return ()
        self._asserted = False
        return (PublishEmergencyStop(False),)

    def _elapsed(self, now_s: float) -> float:
        dt_s = now_s - self._now_s
        self._now_s = now_s
        return min(dt_s, _LONGEST_STEP_S) if dt_s > 0.0 else 0.0  # NaN and backwards: no time

    def _in_emergency(self, inputs: Inputs) -> bool:
        return inputs.emergency_stop or self._asserted

    # --- status ------------------------------------------------------------------------------------------------------

    def _report(self, inputs: Inputs, dt_s: float, *, forced: bool) -> tuple[Effect, ...]:
        self._awake = self._awake or (inputs.pose is not None and inputs.safety_known)
        record = self._record
        eta = math.nan if self._held else status.eta_s(record, inputs, self._speed.mps, self._leg.waited_s)
        built = status.build(
            record,
            self._answer,
            inputs,
            reasons=(record.reason, self._held, self._journal_problem),
            eta=eta,
            emergency=self._in_emergency(inputs),
            low=bool(self._battery_low(inputs)),
            docking=display.Docking(docking.task_of(record, self._docks), self._calls.state),
            setting_out=self._departure.warning
            or inputs.setting_out
            or (self._leg.goal_due and not guards.held_in_ride(inputs)),
            waiting=self._departure.stood_s > self._params.shown_waiting_after_s,
            moving=self._departure.moving,
            awake=self._awake,
            announced=self._announcements.current,
        )
        return (ev.ReportStatus(built),) if self._reporting.due(built, record, dt_s, forced=forced) else ()
