"""The button's node as a process on a real engine process; when it publishes what: tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from robot_stack.contract import topics
from tests.support.engine import BUTTON_PRESSED, BUTTON_RELEASED, TestEngine
from tests.support.processes import NodeProcess

if TYPE_CHECKING:
    from tests.support.peer import Peer

Start = Callable[..., NodeProcess]
NAME = "emergency_stop_button"


def test_a_press_and_a_release_at_a_real_engine(start: Start, peer: Peer, tmp_path: Path) -> None:
    engine = TestEngine(start, tmp_path)
    sources = peer.listen(topics.EMERGENCY_STOP_SOURCES)
    engine.run().up()
    try:
        button = start(NAME)
        # An engine that the machine holds up for a moment is a press, which ends by itself.
        sources.wait(lambda message: message.name == NAME and not message.pressed, "a report of no press")
        engine.set(input0=BUTTON_PRESSED)
        sources.wait(lambda message: message.pressed and message.pid == button.pid, "a report of the press")
        engine.set(input0=BUTTON_RELEASED)
        sources.wait(lambda message: not message.pressed, "a report of the release")
        button.signal(signal.SIGTERM)
        assert button.wait() == 0
    finally:
        engine.close()


def test_bad_parameters_stop_the_start(start: Start) -> None:
    process = start(NAME, "-p", "debounce_s:=0.0")
    assert process.wait() == 2
    assert "debounce_s" in process.output()
