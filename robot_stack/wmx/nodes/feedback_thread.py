"""A thread of its own for joint states: 500 Hz on absolute deadlines, independent of the node's other work."""

from __future__ import annotations

import gc
import math
import sys
import threading
import time
import traceback
from collections.abc import Callable

from robot_stack.core.pacing import Pacer, Sleeper, sharpen_sleep
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot, axis_feedback
from robot_stack.wmx.manipulator.bring_up import BringUp

# Switch interval of the interpreter for this thread; callbacks of the node's executor take longer.
_SWITCH_INTERVAL_S = 0.0002
_END_POLL_S = 0.02
# Period of reading the whole status; in between only the joints are read.
_STATUS_PERIOD_S = 0.05
_JOIN_MARGIN_S = 1.0


class FeedbackThread:
    """Brings the manipulator up and, while it is valid, publishes the joints' feedback once per period.

    publish: called in the thread with fresh feedback; returns why it was invalid, else an empty text. stopped: an
    emergency stop is active. For reports: ``skipped`` counts the periods after the start without a message,
    ``reason`` is that of the last one; ``failure`` is the traceback of a thread that ended by an exception.
    """

    def __init__(
        self,
        bring_up: BringUp,
        publish: Callable[[AxisFeedback], str],
        stopped: Callable[[], bool],
        rate_hz: float,
        poll_s: float,
        end_timeout_s: float,
    ) -> None:
        self._bring_up = bring_up
        self._publish = publish
        self._stopped = stopped
        self._period_ns = round(1e9 / rate_hz)
        self._poll_ns = round(1e9 * poll_s)
        self._end_timeout_s = end_timeout_s
        self._ended = False
        self._status_due_s = -math.inf
        self.snapshot: StatusSnapshot | None = None
        self.published = self.skipped = self.overruns = 0
        self.worst_late_ns = 0
        self.reason = ""
        self.failure = ""
        self._thread = threading.Thread(target=self._run, name="feedback", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> bool:
        """Returns True when the device is closed, or False on timeout."""
        self._ended = True
        if self._thread.is_alive():
            self._thread.join(self._end_timeout_s + _JOIN_MARGIN_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            self._loop()
            self._give_back()
        except Exception:
            self.failure = traceback.format_exc()

    def _loop(self) -> None:
        sys.setswitchinterval(_SWITCH_INTERVAL_S)
        sharpen_sleep()
        pacer = Pacer(self._period_ns, Sleeper())
        frozen = False
        while not self._ended:
            self._tick()
            ready = self.snapshot is not None or self._bring_up.started
            pacer.period_ns = self._period_ns if ready else self._poll_ns
            if not frozen and self.published:
                gc.collect()
                gc.freeze()  # present objects stay: exclude them from garbage collection during ticks
                frozen = True
            pacer.wait()
            self.worst_late_ns = max(self.worst_late_ns, pacer.late_ns)
            self.overruns = pacer.missed

    def _tick(self) -> None:
        now_s = time.monotonic()
        feedback = self._bring_up.look(now_s) if now_s < self._status_due_s else None
        if feedback is None:
            feedback = self._poll(now_s)
        problem = self._bring_up.state.text if feedback is None else self._publish(feedback)
        if feedback is not None and not problem:
            self.published += 1
            return
        self.snapshot = None
        self._status_due_s = -math.inf
        if self._bring_up.started:
            self.skipped += 1
            self.reason = problem

    def _poll(self, now_s: float) -> AxisFeedback | None:
        self.snapshot = self._bring_up.poll(now_s, stop=self._stopped())
        self._status_due_s = now_s + _STATUS_PERIOD_S
        return None if self.snapshot is None else axis_feedback(self.snapshot)

    def _give_back(self) -> None:
        end_s = time.monotonic() + self._end_timeout_s
        while not self._bring_up.end(hurry=time.monotonic() > end_s):
            time.sleep(_END_POLL_S)
