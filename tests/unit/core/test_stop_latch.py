"""The two-key rule, event by event."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.stop_latch import StopLatch


# Events as ``on_emergency_stop`` (S: stop, r: release) and ``on_safety_status`` (E: emergency, n: none), and after each
# of them whether the latch is active.
@pytest.mark.parametrize(
    ("monitored", "events", "active"),
    [
        (True, "", ""),
        (True, "SrnEn", "11110"),  # a status without an emergency before one with it releases nothing
        (True, "SEnr", "1110"),  # the button is still pressed
        (True, "En", "10"),
        (False, "SrnSrEn", "1001110"),  # released by the button alone until the first status
    ],
)
def test_two_keys(monitored: bool, events: str, active: str) -> None:
    latch = StopLatch(monitored=monitored)
    assert not latch.active
    seen = ""
    for event in events:
        (latch.on_emergency_stop if event in "Sr" else latch.on_safety_status)(event in "SE")
        seen += "1" if latch.active else "0"
    assert seen == active


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
