"""A thread of its own for joint states: 500 times a second, on absolute deadlines, whatever else the node does."""

from __future__ import annotations

import gc
import sys
import threading
import time
import traceback
from collections.abc import Callable

from robot_stack.core.pacing import sharpen_sleep
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.manipulator.bring_up import BringUp
from robot_stack.wmx.manipulator.startup import Step

# A thread that wants the interpreter asks for it after this long; callbacks of the node's executor take longer.
_SWITCH_INTERVAL_S = 0.0002
_END_POLL_S = 0.02
_JOIN_MARGIN_S = 1.0


class FeedbackThread:
    """Brings the manipulator up and, while that holds, publishes every status once per period.

    publish: called in the thread with a fresh status; False if it was not fit to be published. stopped: an emergency
    stop is in force. Counters are for whoever reports: ``skipped`` those periods after the start that had nothing to
    publish, for the ``reason`` of the last; ``failure`` is the traceback of a thread that ended by an exception.
    """

    def __init__(
        self,
        bring_up: BringUp,
        publish: Callable[[StatusSnapshot], bool],
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
        self.snapshot: StatusSnapshot | None = None
        self.published = self.skipped = self.overruns = 0
        self.worst_late_ns = 0
        self.reason = ""
        self.failure = ""
        self._thread = threading.Thread(target=self._run, name="feedback", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> bool:
        """Returns when the device is given back, at the latest when the time for it is over: then False."""
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
        due_ns = time.monotonic_ns()
        frozen = False
        while not self._ended:
            self._tick()
            ready = self.snapshot is not None or self._bring_up.progress.step is Step.READY
            period_ns = self._period_ns if ready else self._poll_ns
            if not frozen and self.published:
                gc.collect()
                gc.freeze()  # what is there now stays: spare the ticks the search for garbage in it
                frozen = True
            due_ns = self._sleep_until(due_ns + period_ns, period_ns)

    def _tick(self) -> None:
        bring_up = self._bring_up
        snapshot = bring_up.poll(time.monotonic(), self._stopped)
        if snapshot is not None and self._publish(snapshot):
            self.snapshot = snapshot
            self.published += 1
            return
        self.snapshot = None
        if bring_up.progress.step is Step.READY:
            self.skipped += 1
            self.reason = bring_up.status_problem

    def _sleep_until(self, due_ns: int, period_ns: int) -> int:
        """The deadline that was kept: ticks that are past by a whole period are left out, never made up for."""
        left_ns = due_ns - time.monotonic_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
            late_ns = time.monotonic_ns() - due_ns
        else:
            late_ns = -left_ns
        self.worst_late_ns = max(self.worst_late_ns, late_ns)
        if late_ns < period_ns:
            return due_ns
        missed = late_ns // period_ns
        self.overruns += missed
        return due_ns + missed * period_ns

    def _give_back(self) -> None:
        end_s = time.monotonic() + self._end_timeout_s
        while not self._bring_up.end(hurry=time.monotonic() > end_s):
            time.sleep(_END_POLL_S)
