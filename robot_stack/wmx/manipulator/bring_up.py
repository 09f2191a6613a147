"""The manipulator's session with the engine: from no connection to enabled servos, and back after a loss.

``poll`` is called from one thread and never waits for an effect: it reads the status, and requests the step that is
due. ``look`` is for the time between polls, in which only the joints change. Requests are round
trips to the engine; once everything is ready there are none, only the status is read.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot
from robot_stack.wmx.device_opener import OpenEngine
from robot_stack.wmx.failures import ABSENT, BUSY
from robot_stack.wmx.manipulator.startup import (
    START,
    Level,
    Line,
    Outcome,
    Progress,
    Result,
    Rule,
    Step,
    advance,
    back_to,
    is_past,
)
from robot_stack.wmx.manipulator.steps import StartupRequests
from robot_stack.wmx.session import EngineSession, Events, Patience

_PROBE_S = 0.5


@dataclass(frozen=True, slots=True)
class BringUpSettings:
    """n_joints: joint j is axis j. parameter_file: empty for none. stale_s: timeout of the cycle counter, after which
    the status is invalid. rules: one for each step.
    """

    n_joints: int
    names: tuple[str, ...]
    parameter_file: str
    auto_servo_on: bool
    stop_communication: bool
    stale_s: float
    rules: Mapping[Step, Rule]


class BringUp:
    """Belongs to one thread. Times are steady seconds. ``progress`` and ``lines`` may be read from another."""

    def __init__(self, open_engine: OpenEngine, settings: BringUpSettings) -> None:
        """open_engine: opens a device after a short wait at most; raises EngineError."""
        # That step's rule sets the retry period of a device: the session opens one on request.
        patience = Patience(retry_s=0.0, attempts=1, attempt_pause_s=0.0, probe_period_s=_PROBE_S)
        self._session = EngineSession(open_engine, patience, Events(lost=self._begin_anew))
        self._settings = settings
        self._asker: StartupRequests | None = None
        self._cycle = -1
        self._cycle_s = math.inf
        self._was_ready = False
        self._up = False
        self.progress: Progress = START
        self.status_problem = ""
        self.lines: deque[Line] = deque(maxlen=200)

    # --- the next step -----------------------------------------------------------------------------------------------

    def poll(self, now_s: float, stopped: Callable[[], bool]) -> StatusSnapshot | None:
        """The present status while the joints are valid: the bus runs, parameters are set, cycles continue.

        stopped: whether an emergency stop is active, during which no servo is switched on.
        """
        engine = self._session.engine
        if engine is None:
            self._open(now_s)
            return None
        code, snapshot = engine.read_status()
        if self._up and not code and snapshot.communicating and snapshot.cycle_counter != self._cycle:
            self._cycle, self._cycle_s = snapshot.cycle_counter, now_s  # usually nothing else is to be done
            return snapshot
        if not self._readable(engine, code, snapshot, now_s):
            return None
        if not snapshot.communicating:
            self._on_silence(snapshot)
        if self.progress.step is not Step.READY:
            self._work(snapshot, now_s, stopped)
        usable = snapshot.communicating and is_past(self.progress.step, Step.PARAMETERS)
        if not usable or self._standing_still(snapshot, now_s):
            return None
        self._up = self.progress.step is Step.READY
        self.status_problem = ""
        return snapshot

    def look(self, now_s: float) -> AxisFeedback | None:
        """The joints' feedback while the state is as in the last ``poll``; None: call ``poll`` again."""
        engine = self._session.engine
        if not self._up or engine is None:
            return None
        feedback = engine.read_feedback()
        if feedback is None or not feedback.communicating or feedback.cycle_counter == self._cycle:
            return None
        self._cycle, self._cycle_s = feedback.cycle_counter, now_s
        return feedback

    def _open(self, now_s: float) -> None:
        if not self.progress.due(now_s):
            return
        error = self._session.open()
        if error is None and self._session.engine is not None:
            self._asker = StartupRequests(
                self._session.engine, self._settings.n_joints, self._settings.names, self._report
            )
            outcome = Outcome(Result.DONE, "open")
        elif error is None or error.code in ABSENT - BUSY:
            outcome = Outcome(Result.HELD, "waiting for the motion engine")
        else:
            outcome = Outcome(Result.REFUSED, str(error))
        self._on_outcome(outcome, now_s)

    def _readable(self, engine: MotionEngine, code: int, snapshot: StatusSnapshot, now_s: float) -> bool:
        self._up = False
        if code:
            self.status_problem = f"status: {engine.api.ErrorToString(code)} (error {code})"
            self._session.check_code(code)
            self._session.probe(now_s)  # the status of a dead engine only ages
            return False
        if snapshot.n_axes < self._settings.n_joints:
            self.status_problem = f"the engine has {snapshot.n_axes} axes, joint_number is {self._settings.n_joints}"
            return False
        return True

    def _standing_still(self, snapshot: StatusSnapshot, now_s: float) -> bool:
        if snapshot.cycle_counter != self._cycle:
            self._cycle, self._cycle_s = snapshot.cycle_counter, now_s
            return False
        if now_s - self._cycle_s < self._settings.stale_s:
            return False
        self.status_problem = "the engine's cycles do not advance"
        return True

    def _on_silence(self, snapshot: StatusSnapshot) -> None:
        """Handles a bus that does not run. After a loss it is restarted; after a client's stop, only that client
        restarts it. An engine that does not distinguish the two, like the vendor's, counts as lost.
        """
        self.status_problem = "no communication with the drives"
        if not is_past(self.progress.step, Step.COMMUNICATION):
            return
        stopped = snapshot.engine_error == ErrorCode.PyNone
        text = "communication was stopped by another device" if stopped else "communication with the drives is lost"
        assert self._asker is not None
        self._asker.bus_is_others = stopped
        self._report(Line(Level.ERROR, text))
        self.progress = back_to(Step.COMMUNICATION, text)

    def _work(self, snapshot: StatusSnapshot, now_s: float, stopped: Callable[[], bool]) -> None:
        progress, asker = self.progress, self._asker
        assert asker is not None
        if progress.waiting:
            self._on_outcome(asker.look(progress.step, snapshot), now_s)
        elif progress.due(now_s):
            self._on_outcome(self._ask(asker, snapshot, stopped()), now_s)

    def _ask(self, asker: StartupRequests, snapshot: StatusSnapshot, stop: bool) -> Outcome:
        settings = self._settings
        match self.progress.step:
            case Step.SCAN:
                return asker.scan(snapshot)
            case Step.COMMUNICATION:
                return asker.start_communication(snapshot)
            case Step.PARAMETERS:
                return asker.import_parameters(settings.parameter_file)
            case Step.AXIS_REPORT:
                return asker.report_axes()
            case Step.CLEAR_ALARMS:
                return asker.clear_alarms(snapshot, settings.auto_servo_on, stop)
            case Step.SERVO_ON:
                return asker.switch_on(snapshot, settings.auto_servo_on, stop)
        raise AssertionError(self.progress.step)

    def _on_outcome(self, outcome: Outcome, now_s: float) -> None:
        before = self.progress.step
        self.progress, line = advance(self.progress, outcome, now_s, self._settings.rules)
        if line is not None:
            self._report(line)
        if before is Step.COMMUNICATION and self.progress.step is not before and self._was_ready:
            # The engine still has its parameters. Servos that a fault or a client switched off stay off: only a start
            # switches them on, not a restored connection.
            self.progress = Progress(Step.READY)
        self._was_ready = self._was_ready or self.progress.step is Step.READY

    def _begin_anew(self) -> None:
        """Restarts the sequence: the device is invalid."""
        text = self._session.text
        self._report(Line(Level.ERROR, text))
        self._asker = None
        self._was_ready = False
        self.status_problem = text
        self.progress = back_to(Step.DEVICE, text)

    def _report(self, line: Line) -> None:
        self.lines.append(line)

    # --- the end -----------------------------------------------------------------------------------------------------

    def end(self, hurry: bool) -> bool:
        """Undoes this session's steps: servos off once their joints stand, the bus, the device. True when done.

        hurry: switches servos off even if joints still move.
        """
        engine = self._session.engine
        if engine is None or self._asker is None:
            return True
        code, snapshot = engine.read_status()
        if not code and snapshot.communicating and not self._asker.switch_off(snapshot, hurry):
            return False
        if not code and self._settings.stop_communication:
            self._asker.stop_communication()
        self._session.close()
        self._asker = None
        return True
