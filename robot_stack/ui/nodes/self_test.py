"""Runs the guided self test for one page, and reports its results."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from robot_stack.contract import services
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.report import diagnostic_status
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.audit_file import AuditFile
from robot_stack.ui.nodes.inputs import RobotInputs
from robot_stack.ui.nodes.operator_requests import REFUSED, OperatorRequest
from robot_stack.ui.nodes.outputs import Outputs
from robot_stack.ui.nodes.self_test_file import SelfTestFile
from robot_stack.ui.params import TouchUiParams
from robot_stack.ui.self_test import Effect, Reason, ResetAnswer, SelfTest, planned_steps, refusal
from robot_stack.ui.self_test_record import Record, age_h, failed, is_due, new_record

NOT_SHOWN, BUSY, NO_TEST, OTHER_STEP = (
    "answer.test_not_shown",
    "answer.test_busy",
    "answer.test_none",
    "answer.test_other_step",
)
# Times shown on a page change in steps, so that it is not sent every second.
_LEFT_STEP_S = 5


class GuidedSelfTest:
    """In the node's own loop.

    testers: the connected pages of staff that show the self test, and how often each has opened it: a page that was
    left and opened again between two ticks has left its test.
    """

    def __init__(
        self,
        node: StackNode,
        params: TouchUiParams,
        inputs: RobotInputs,
        outputs: Outputs,
        history: AuditFile,
        testers: Callable[[], Mapping[int, int]],
    ) -> None:
        self._node, self._params, self._testers = node, params.self_test, testers
        self._inputs, self._outputs, self._history = inputs, outputs, history
        self._steps = planned_steps(self._params, node.get_name())
        self._reset = OperatorRequest(node, params.reset, services.SAFETY_RESET, params.reset.tries)
        self._try_reset = OperatorRequest(node, params.reset, services.SAFETY_RESET, 1)
        self._file = SelfTestFile()
        self._test: SelfTest | None = None
        self._client, self._opened, self._who = 0, 0, ""
        node.report.more = lambda: [self._status()]

    def handle(self, client: int, message: p.SelfTest, who: str) -> str:
        """Returns the key of a refusal, empty if the message is accepted."""
        now_s = self._node.steady_s()
        if message.act == "begin":
            return self._begin(client, who, now_s)
        test = self._test
        if test is None or client != self._client:
            return NO_TEST if test is None else BUSY
        if message.act == "cancel":
            test.abort(Reason.CANCELLED, now_s)
        elif message.step != test.at:
            return OTHER_STEP  # the page showed an earlier step
        elif message.act == "fail":
            test.fail(now_s)
        else:
            self._do(test, test.confirm(now_s))
        self._end_if_over(test)
        return ""

    def tick(self) -> None:
        """Call at the rate of the pages."""
        test = self._test
        if test is None:
            return
        now_s = self._node.steady_s()
        if self._testers().get(self._client) != self._opened:
            test.abort(Reason.LEFT, now_s)
        self._do(test, test.observe(self._inputs.self_test(), now_s))
        self._end_if_over(test)

    # --- for pages and /diagnostics ----------------------------------------------------------------------------------

    def section(self) -> dict[str, Any]:
        """The running test, its steps, and the last result."""
        test, last = self._test, self._file.memory.last
        return {
            "steps": [{"kind": step.kind.value, "target": step.target} for step in self._steps],
            "running": test is not None,
            "at": test.at if test else 0,
            "left_s": _LEFT_STEP_S * math.ceil(test.left_s / _LEFT_STEP_S) if test else 0,
            "confirm": bool(test and test.takes_confirmation),
            "last": _last(last) if last else None,
            "stored": self._file.stored,
        }

    def summary(self) -> dict[str, Any]:
        """Age of the last test that passed, for the reminder on staff pages."""
        memory, now_s = self._file.memory, _utc_now().timestamp()
        hours = age_h(memory, now_s)
        return {
            "due": is_due(memory, now_s, self._params.due_h),
            "failed": failed(memory),
            "age_h": math.floor(hours) if math.isfinite(hours) else None,
        }

    def _status(self) -> DiagnosticStatus:
        memory, now_s = self._file.memory, _utc_now().timestamp()
        hours, due = age_h(memory, now_s), is_due(memory, now_s, self._params.due_h)
        passed = f"passed {hours:.0f} h ago" if math.isfinite(hours) else "never passed"
        last = memory.last
        warn = due or not self._file.stored
        text = f"last one failed; {passed}" if failed(memory) else passed
        text += "; due" if due else ""
        text += "" if self._file.stored else "; the result is not stored: the disk cannot be written"
        values = {
            "passed_age_h": f"{hours:.2f}",
            "due_h": f"{self._params.due_h:.2f}",
            "due": str(due),
            "last_verdict": last.verdict.value if last else "none",
            "last_step": last.step if last else "",
            "last_reason": last.reason.value if last and last.reason else "",
            "stored": str(self._file.stored),
        }
        level = DiagnosticStatus.WARN if warn else DiagnosticStatus.OK
        return diagnostic_status(f"{self._node.get_name()}: self test", level, text, values.items())

    # --- the run -----------------------------------------------------------------------------------------------------

    def _begin(self, client: int, who: str, now_s: float) -> str:
        if self._test is not None:
            return BUSY
        opened = self._testers().get(client)
        if opened is None:
            return NOT_SHOWN
        why = refusal(self._inputs.self_test(), self._params)
        if not why:
            self._test = SelfTest(self._params, self._steps, now_s)
            self._client, self._opened, self._who = client, opened, who
        return why

    def _do(self, test: SelfTest, effect: Effect | None) -> None:
        match effect:
            case Effect.TRY_RESET:
                self._try_reset.ask(self._answer_for(test))
            case Effect.RESET:
                self._reset.ask(self._answer_for(test))
            case Effect.RELEASE:
                self._outputs.ask_release()
            case Effect.STOP:
                self._outputs.stop()

    def _answer_for(self, test: SelfTest) -> Callable[[bool, str, str], None]:
        def answer(granted: bool, why: str, _: str) -> None:
            typed = ResetAnswer.GRANTED if granted else ResetAnswer.REFUSED if why == REFUSED else ResetAnswer.NONE
            self._do(test, test.answer(typed, self._node.steady_s()))
            self._end_if_over(test)

        return answer

    def _end_if_over(self, test: SelfTest) -> None:
        if test.end is None or test is not self._test:
            return
        self._test = None
        now = _utc_now()
        record = new_record(test.end, self._who, now.timestamp(), now.isoformat(timespec="seconds"))
        self._file.add(record)
        outcome = " ".join(filter(None, (record.verdict.value, record.step, record.reason)))
        self._history.add(self._who, "self test", outcome if self._file.stored else f"{outcome} (not stored)")


def _utc_now() -> datetime:
    """The system time, also in a simulation: the age of a result counts across restarts."""
    return datetime.now(UTC)


def _last(record: Record) -> dict[str, Any]:
    kind, _, target = record.step.partition(" ")
    return {
        "at": record.at,
        "verdict": record.verdict.value,
        "reason": record.reason.value if record.reason else "",
        "kind": kind,
        "target": target,
        "duration_s": round(record.duration_s),
    }
