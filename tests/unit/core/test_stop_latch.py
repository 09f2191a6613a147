"""The two-key rule, event by event."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.stop_latch import StopLatch


def test_free_at_first() -> None:
    assert not StopLatch().active


def test_true_stops_at_once_and_false_alone_releases_nothing() -> None:
    latch = StopLatch()
    latch.on_emergency_stop(True)
    assert latch.active
    latch.on_emergency_stop(False)
    assert latch.active


def test_inactive_status_before_active_status_does_not_release_latch() -> None:
    latch = StopLatch()
    latch.on_emergency_stop(True)
    latch.on_emergency_stop(False)
    latch.on_safety_status(False)
    assert latch.active
    latch.on_safety_status(True)
    latch.on_safety_status(False)
    assert not latch.active


def test_status_clean_but_button_still_pressed() -> None:
    latch = StopLatch()
    latch.on_emergency_stop(True)
    latch.on_safety_status(True)
    latch.on_safety_status(False)
    assert latch.active
    latch.on_emergency_stop(False)
    assert not latch.active


def test_an_emergency_in_the_status_alone_stops() -> None:
    latch = StopLatch()
    latch.on_safety_status(True)
    assert latch.active
    latch.on_safety_status(False)
    assert not latch.active


def test_unmonitored_latch_releases_on_false_until_first_safety_status() -> None:
    latch = StopLatch(monitored=False)
    latch.on_emergency_stop(True)
    assert latch.active
    latch.on_emergency_stop(False)
    assert not latch.active
    latch.on_safety_status(False)
    latch.on_emergency_stop(True)
    latch.on_emergency_stop(False)
    assert latch.active
    latch.on_safety_status(True)
    latch.on_safety_status(False)
    assert not latch.active


@given(st.booleans(), st.lists(st.tuples(st.sampled_from(["stop", "status"]), st.booleans())))
def test_never_free_while_the_last_word_of_either_key_says_stop(
    monitored: bool, events: list[tuple[str, bool]]
) -> None:
    latch = StopLatch(monitored=monitored)
    last = {"stop": False, "status": False}
    for kind, value in events:
        (latch.on_emergency_stop if kind == "stop" else latch.on_safety_status)(value)
        last[kind] = value
        if last["stop"] or last["status"]:
            assert latch.active
