"""The guided self test of the stops: every step, every way to fail, its records, and when the next one is due."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.ui import self_test as s
from robot_stack.ui.nodes import self_test_file
from robot_stack.ui.nodes.self_test_file import SelfTestFile
from robot_stack.ui.params import SelfTestParams, TouchUiParams
from robot_stack.ui.self_test import SCREEN, Effect, Kind, Reason, ResetAnswer, Seen, SelfTest, Verdict
from robot_stack.ui.self_test_record import Memory, Record, after, age_h, is_due, new_record, parse_memory

TICK_S = 0.2
BUTTON, UI = "emergency_stop_button", "touch_ui"
READY = Seen(emergency=False, sources={BUTTON: False, UI: False}, speed=(0.0, 0.0), ride_active=False, passenger=False)
STOPPED = replace(READY, emergency=True, pressed_row=True)


def pressed(*names: str) -> Seen:
    return replace(STOPPED, sources={name: name in names for name in (BUTTON, UI)})


class Run:
    """A test on a robot that reacts correctly. tick: observes for a duration and returns the effects."""

    def __init__(self, params: SelfTestParams) -> None:
        self.now_s = 100.0
        self.test = SelfTest(params, s.planned_steps(params, UI), self.now_s)

    def tick(self, seen: Seen, duration_s: float = TICK_S) -> list[Effect]:
        found = []
        for _ in range(round(duration_s / TICK_S)):
            self.now_s += TICK_S
            found.append(self.test.observe(seen, self.now_s))
        return [effect for effect in found if effect is not None]

    def answer(self, answer: ResetAnswer) -> Effect | None:
        return self.test.answer(answer, self.now_s)

    def confirm(self) -> Effect | None:
        return self.test.confirm(self.now_s)

    def is_at(self, kind: Kind, target: str) -> bool:
        return self.test.end is None and (self.test.step.kind, self.test.step.target) == (kind, target)

    def press(self, source: str = BUTTON) -> None:
        assert self.tick(pressed(source)) == [Effect.TRY_RESET]

    def be_refused(self) -> None:
        assert self.answer(ResetAnswer.REFUSED) is None

    def release(self) -> None:
        assert self.tick(STOPPED, 1.4) == []

    def reset(self) -> None:
        assert self.confirm() is Effect.RESET
        assert self.answer(ResetAnswer.GRANTED) is None
        assert self.tick(READY) == []

    def pass_buttons(self) -> Run:
        for target in ("passenger", "left", "right"):
            assert self.is_at(Kind.PRESS, target)
            self.press()
            self.be_refused()
            self.release()
            self.reset()
        return self

    def pass_checks(self) -> Run:
        self.pass_buttons().press(UI)
        self.be_refused()
        while self.test.step.kind is Kind.CHECK:
            self.tick(pressed(UI))
            assert self.confirm() is None
        return self

    def reason(self) -> Reason | None:
        return self.test.end.reason


@pytest.fixture
def self_test(params: TouchUiParams) -> SelfTestParams:
    return params.self_test


@pytest.fixture
def run(self_test: SelfTestParams) -> Run:
    return Run(self_test)


def test_whole_procedure_passes_and_never_commands_motion(run: Run, self_test: SelfTestParams) -> None:
    run.pass_checks()
    assert run.is_at(Kind.RELEASE, SCREEN)
    assert run.tick(pressed(UI), 5.0) == []  # the stop of the screen is released only after a touch
    assert run.confirm() is Effect.RELEASE
    run.release()
    assert run.is_at(Kind.RESET, SCREEN)
    run.reset()
    assert (run.test.end.verdict, run.test.end.step, run.test.end.reason) == (Verdict.PASSED, "", None)
    assert run.test.end.duration_s == pytest.approx(run.now_s - 100.0)
    assert [step.target for step in run.test.steps if step.kind is Kind.CHECK] == list(self_test.checks)
    assert {effect.value for effect in Effect} == {"try reset", "reset", "release", "stop"}


def test_nothing_follows_the_end(run: Run) -> None:
    run.test.abort(Reason.CANCELLED, run.now_s)
    end = run.test.end
    assert run.tick(pressed(BUTTON), 100.0) == []
    assert run.confirm() is None
    assert run.answer(ResetAnswer.GRANTED) is None
    run.test.fail(run.now_s)
    run.test.abort(Reason.LEFT, run.now_s)
    assert run.test.end is end
    assert not run.test.takes_confirmation


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({}, ""),
        ({"emergency": None}, s.UNKNOWN_STATE),
        ({"speed": None}, s.UNKNOWN_STATE),
        ({"ride_active": None}, s.UNKNOWN_STATE),
        ({"passenger": None}, s.UNKNOWN_STATE),
        ({"speed": (0.031, 0.0)}, s.MOVING),
        ({"speed": (0.0, -0.051)}, s.MOVING),
        ({"speed": (math.nan, 0.0)}, s.MOVING),
        ({"ride_active": True}, s.RIDE_ACTIVE),
        ({"passenger": True}, s.PASSENGER_ABOARD),
        ({"emergency": True}, s.STOP_ACTIVE),
        ({"sources": {BUTTON: True}}, s.STOP_ACTIVE),
    ],
)
def test_begin_is_refused_unless_the_robot_stands_empty_and_released(
    self_test: SelfTestParams, change: dict[str, Any], why: str
) -> None:
    assert s.refusal(replace(READY, **change), self_test) == why


def timeout_of(kind: Kind, params: SelfTestParams) -> float:
    return {Kind.REFUSED: params.refused_s, Kind.CHECK: params.check_s}.get(kind, params.press_s)


@pytest.mark.parametrize(
    ("kind", "target", "seen"),
    [
        (Kind.PRESS, "passenger", READY),
        (Kind.REFUSED, "passenger", pressed(BUTTON)),
        (Kind.RELEASE, "passenger", pressed(BUTTON)),
        (Kind.RESET, "passenger", STOPPED),
        (Kind.CHECK, "latch", pressed(UI)),
        (Kind.RELEASE, SCREEN, pressed(UI)),
    ],
)
def test_each_step_has_a_timeout(run: Run, self_test: SelfTestParams, kind: Kind, target: str, seen: Seen) -> None:
    if target == "latch":
        run.pass_buttons().press(UI)
        run.be_refused()
    elif target == SCREEN:
        run.pass_checks()
    else:
        for action in (run.press, run.be_refused, run.release)[: list(Kind).index(kind)]:
            action()
    assert run.is_at(kind, target)
    limit_s = timeout_of(kind, self_test)
    run.tick(seen, limit_s - 2.0 * TICK_S)
    assert run.is_at(kind, target)
    assert run.test.left_s > 0.0
    run.tick(seen, 3.0 * TICK_S)
    assert run.test.end.verdict is Verdict.FAILED
    assert (run.test.end.step, run.reason()) == (f"{kind} {target}", Reason.TIMEOUT)


def test_press_needs_the_source_and_the_latched_stop(run: Run) -> None:
    for incomplete in (
        replace(READY, sources={BUTTON: True}),  # the safety monitor does not latch it
        replace(READY, sources={BUTTON: True}, emergency=True),  # an emergency by another row
        replace(READY, sources={BUTTON: True}, emergency=None),
        STOPPED,  # a stop without a source
        replace(STOPPED, sources={}),
    ):
        assert run.tick(incomplete, 3.0) == []
        assert run.is_at(Kind.PRESS, "passenger")
    run.press()


def test_press_of_another_source_fails_the_step_unless_it_only_passes_on_the_stop(
    run: Run, self_test: SelfTestParams
) -> None:
    run.tick(pressed(UI), 0.8)
    run.tick(STOPPED)
    run.tick(pressed(UI), 1.0)
    assert run.is_at(Kind.PRESS, "passenger")
    run.tick(pressed(UI), 0.2)
    assert (run.reason(), run.test.end and run.test.end.step) == (Reason.WRONG_SOURCE, "press passenger")
    run = Run(self_test).pass_buttons()
    run.tick(pressed(BUTTON), 1.4)
    assert (run.reason(), run.test.end and run.test.end.step) == (Reason.WRONG_SOURCE, "press screen")


@pytest.mark.parametrize(("answer", "effect"), [(ResetAnswer.GRANTED, Effect.STOP), (ResetAnswer.REFUSED, None)])
def test_reset_that_is_granted_after_the_test_ended_stops_the_robot(
    run: Run, answer: ResetAnswer, effect: Effect | None
) -> None:
    run.press()
    run.test.abort(Reason.LEFT, run.now_s)
    assert run.answer(answer) is effect
    assert run.reason() is Reason.LEFT


def test_granted_reset_missing_answer_and_early_release_fail_the_refusal(self_test: SelfTestParams) -> None:
    for answer, effect, reason in (
        (ResetAnswer.GRANTED, Effect.STOP, Reason.RESET_GRANTED),
        (ResetAnswer.NONE, None, Reason.NO_MONITOR),
    ):
        run = Run(self_test)
        run.press()
        assert run.answer(answer) is effect
        assert (run.test.end.verdict, run.reason()) == (Verdict.FAILED, reason)
    run = Run(self_test)
    run.press()
    assert run.tick(STOPPED) == []
    assert run.reason() is Reason.RELEASED_EARLY


def test_answers_that_were_not_asked_for_are_ignored(run: Run) -> None:
    assert run.answer(ResetAnswer.GRANTED) is None
    run.press()
    run.be_refused()
    assert run.answer(ResetAnswer.GRANTED) is None
    run.release()
    assert run.answer(ResetAnswer.GRANTED) is None
    assert run.is_at(Kind.RESET, "passenger")


def test_release_must_leave_the_stop_latched_and_the_robot_standing(run: Run) -> None:
    run.press()
    run.be_refused()
    assert run.tick(STOPPED, 1.0) == []
    run.tick(pressed(BUTTON))  # contact bounce starts the second again
    run.tick(STOPPED, 1.0)
    run.tick(replace(STOPPED, speed=None))
    run.tick(STOPPED, 1.0)
    assert run.is_at(Kind.RELEASE, "passenger")
    assert run.tick(READY) == [Effect.STOP]
    assert run.reason() is Reason.STOP_LOST


@pytest.mark.parametrize("to_checks", [False, True])
def test_stop_that_is_lost_before_the_reset_or_during_a_check_fails(run: Run, to_checks: bool) -> None:
    if to_checks:
        run.pass_buttons().press(UI)
        run.be_refused()
    else:
        run.press()
        run.be_refused()
        run.release()
    run.tick(replace(STOPPED, emergency=None), 3.0)  # no status is no proof of a loss
    assert run.test.end is None
    assert run.tick(READY) == [Effect.STOP]
    assert run.reason() is Reason.STOP_LOST


def test_reset_needs_a_touch_a_grant_and_the_end_of_the_row(run: Run) -> None:
    run.press()
    run.be_refused()
    run.release()
    waits = [run.test.takes_confirmation]
    assert run.confirm() is Effect.RESET
    waits.append(run.test.takes_confirmation)
    assert waits == [True, False]
    assert run.confirm() is None  # a second touch
    run.tick(READY)  # the status is faster than the answer
    assert run.is_at(Kind.RESET, "passenger")
    run.answer(ResetAnswer.GRANTED)
    run.tick(replace(READY, pressed_row=True))
    run.tick(STOPPED)
    run.tick(replace(READY, emergency=None))
    assert run.is_at(Kind.RESET, "passenger")
    run.tick(READY)
    assert run.is_at(Kind.PRESS, "left")


@pytest.mark.parametrize(
    ("answer", "reason"), [(ResetAnswer.REFUSED, Reason.RESET_REFUSED), (ResetAnswer.NONE, Reason.NO_MONITOR)]
)
def test_refused_or_unanswered_reset_fails(run: Run, answer: ResetAnswer, reason: Reason) -> None:
    run.press()
    run.be_refused()
    run.release()
    run.confirm()
    assert run.answer(answer) is None
    assert run.reason() is reason


def test_person_can_fail_any_step_and_confirms_only_what_the_robot_cannot_measure(run: Run) -> None:
    assert not run.test.takes_confirmation
    assert run.confirm() is None
    assert run.is_at(Kind.PRESS, "passenger")
    run.pass_buttons().press(UI)
    run.be_refused()
    run.confirm()
    run.test.fail(run.now_s)
    assert (run.reason(), run.test.end and run.test.end.step) == (Reason.PERSON, "check belt")


@pytest.mark.parametrize(
    ("change", "reason", "verdict", "effects"),
    [
        ({"speed": (0.1, 0.0)}, Reason.MOVED, Verdict.FAILED, [Effect.STOP]),
        ({"speed": (0.0, 0.1)}, Reason.MOVED, Verdict.FAILED, [Effect.STOP]),
        ({"ride_active": True}, Reason.RIDE, Verdict.ABORTED, []),
        ({"passenger": True}, Reason.PASSENGER, Verdict.ABORTED, []),
    ],
)
def test_motion_a_ride_or_a_passenger_end_the_test(
    run: Run, change: dict[str, Any], reason: Reason, verdict: Verdict, effects: list[Effect]
) -> None:
    assert run.tick(replace(READY, **change)) == effects
    assert run.reason() is reason
    assert run.test.end.verdict is verdict


def test_abort_releases_nothing(run: Run) -> None:
    run.pass_buttons().press(UI)
    run.test.abort(Reason.LEFT, run.now_s)
    assert (run.test.end.verdict, run.reason(), run.test.end.step) == (Verdict.ABORTED, Reason.LEFT, "refused screen")
    assert run.tick(pressed(UI), 5.0) == []


@pytest.mark.parametrize("now_s", [math.nan, math.inf, 99.9])
@pytest.mark.parametrize("call", ["observe", "confirm", "answer", "fail", "abort"])
def test_times_that_are_no_numbers_or_run_backwards_abort(self_test: SelfTestParams, call: str, now_s: float) -> None:
    run = Run(self_test)
    acts: dict[str, Callable[[], object]] = {
        "observe": lambda: run.test.observe(pressed(BUTTON), now_s),
        "confirm": lambda: run.test.confirm(now_s),
        "answer": lambda: run.test.answer(ResetAnswer.GRANTED, now_s),
        "fail": lambda: run.test.fail(now_s),
        "abort": lambda: run.test.abort(Reason.LEFT, now_s),
    }
    assert acts[call]() is None
    assert run.reason() is Reason.CLOCK
    assert run.test.end.duration_s == 0.0


seen = st.builds(
    Seen,
    emergency=st.sampled_from([None, False, True]),
    pressed_row=st.booleans(),
    sources=st.dictionaries(st.sampled_from([BUTTON, UI, "mission_manager"]), st.booleans()),
    speed=st.sampled_from([None, (0.0, 0.0), (math.nan, 0.0)]),
    ride_active=st.sampled_from([None, False]),
    passenger=st.sampled_from([None, False]),
)


@given(st.lists(st.tuples(st.sampled_from(["observe", "confirm", *ResetAnswer]), seen, st.floats(0.0, 2.0))))
def test_whatever_happens_no_reset_or_release_without_a_touch(actions: list[tuple[str, Seen, float]]) -> None:
    params = SelfTestParams(
        due_h=24.0, buttons=("left",), button_source=BUTTON, checks=("belt",), press_s=60.0, refused_s=10.0,
        check_s=60.0, moving_mps=0.03, moving_radps=0.05,
    )  # fmt: skip
    test = SelfTest(params, s.planned_steps(params, UI), 0.0)
    now_s = 0.0
    for action, what, passed_s in actions:
        now_s += passed_s
        takes, before = test.takes_confirmation, test.at
        effect = test.confirm(now_s) if action == "confirm" else None
        if action == "observe":
            effect = test.observe(what, now_s)
        elif isinstance(action, ResetAnswer):
            effect = test.answer(action, now_s)
        if effect in (Effect.RESET, Effect.RELEASE):
            assert action == "confirm"
            assert takes
        if effect is Effect.TRY_RESET:
            assert test.step.kind is Kind.REFUSED
            assert what.sources[test.step.source]
        assert before <= test.at <= before + 1


def test_sources_by_their_own_reports() -> None:
    reports = s.SourceReports(1.0)
    reports.add(BUTTON, 7, True, 10.0)
    reports.add(UI, 8, False, 10.0)
    assert reports.pressed(11.0) == {BUTTON: True, UI: False}
    reports.add(BUTTON, 9, False, 10.5)  # a second process of that name
    assert reports.pressed(10.5)[BUTTON] is True
    assert reports.pressed(11.2) == {BUTTON: False}
    assert reports.pressed(9.0) == {}
    assert reports.pressed(math.nan) == {}
    for pid in range(1000):
        reports.add("many", pid, True, 20.0 + 1e-3 * pid)
    assert len(reports._reports) == 64


# --- records ---------------------------------------------------------------------------------------------------------

NOW_S = 1_795_694_400.0
HOUR_S = 3600.0
PASSED = s.End(Verdict.PASSED, 95.04)
FAILED = s.End(Verdict.FAILED, 12.0, "press left", Reason.TIMEOUT)
ABORTED = s.End(Verdict.ABORTED, 3.0, "press left", Reason.LEFT)


def record(end: s.End) -> Record:
    return new_record(end, "page 1 127.0.0.1 staff", NOW_S, "2026-11-26T12:00:00+00:00")


def test_due_after_a_day_after_a_failure_and_without_a_pass() -> None:
    memory = after(Memory(), record(PASSED))
    assert not is_due(memory, NOW_S + 24.0 * HOUR_S, 24.0)
    assert is_due(memory, NOW_S + 24.0 * HOUR_S + 1.0, 24.0)
    assert not is_due(memory, NOW_S + 99.0 * HOUR_S, 0.0)
    assert is_due(memory, NOW_S - 1.0, 24.0)  # the clock was set back
    assert is_due(Memory(), NOW_S, 24.0)
    assert not is_due(Memory(), NOW_S, 0.0)
    broken = after(memory, record(FAILED))
    assert is_due(broken, NOW_S, 24.0)
    assert age_h(broken, NOW_S + 5.0 * HOUR_S) == 5.0  # the earlier pass is kept
    assert not is_due(after(memory, record(ABORTED)), NOW_S, 24.0)
    assert is_due(after(broken, record(ABORTED)), NOW_S + 25.0 * HOUR_S, 24.0)
    assert math.isinf(age_h(Memory(), NOW_S))


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(self_test_file, "state_dir", lambda: tmp_path / "state")
    return tmp_path / "state"


def test_results_survive_a_restart(state: Path) -> None:
    file = SelfTestFile()
    assert file.memory == Memory()
    for end in (PASSED, FAILED):
        file.add(record(end))
    again = SelfTestFile()
    assert again.stored
    assert again.memory == file.memory
    assert again.memory.passed == record(PASSED)
    assert again.memory.last == record(FAILED)
    assert again.memory.last.duration_s == 12.0
    lines = (state / "touch_ui_self_tests.jsonl").read_text(encoding="utf-8").splitlines()
    assert [Record.model_validate_json(line).verdict for line in lines] == [Verdict.PASSED, Verdict.FAILED]


@pytest.mark.parametrize("text", ["", "[]", '{"last": 1}', "\ufffd"])
def test_damaged_file_counts_as_no_test(state: Path, text: str) -> None:
    assert parse_memory(text) == Memory()
    state.mkdir()
    (state / "touch_ui_self_test.json").write_text(text, encoding="utf-8")
    assert SelfTestFile().memory == Memory()


def test_full_disk_is_reported_and_keeps_what_was_stored(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = SelfTestFile()
    file.add(record(PASSED))
    log = (state / "touch_ui_self_tests.jsonl").read_text(encoding="utf-8")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.fsync", full)
        file.add(record(FAILED))
        assert not file.stored
        assert file.memory.last == record(FAILED)  # known until the node ends
        with pytest.raises(OSError, match="No space"):
            self_test_file._append(state / "touch_ui_self_tests.jsonl", "half a line")
    assert (state / "touch_ui_self_tests.jsonl").read_text(encoding="utf-8") == log
    assert SelfTestFile().memory.last == record(PASSED)
    assert [path.name for path in state.iterdir() if path.name.startswith(".new-")] == []
    file.add(record(PASSED))
    assert file.stored


def test_each_button_and_check_is_named_once(self_test: SelfTestParams) -> None:
    for name in ("buttons", "checks"):
        first = getattr(self_test, name)[0]
        with pytest.raises(ValueError, match=f"{name} must name each entry once"):
            SelfTestParams.model_validate({**self_test.model_dump(), name: (first, first)})
