"""The bridge and the simulated firmware as processes on a pseudo terminal. Their faults: tests/simulated/nodes."""

from __future__ import annotations

import json
import os
from pathlib import Path

from custom_msgs.msg import EHMIState, SafetyStatus
from robot_stack.contract import topics
from robot_stack.contract.display import Display


def test_a_state_reaches_the_display_over_a_terminal_that_goes_with_it(peer, start) -> None:
    shown, status = peer.listen(topics.SIM_EHMI_DISPLAY), peer.listen(topics.EHMI_STATUS)
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 20.0)
    display, bridge = start("ehmi_display"), start("ehmi_bridge", "-p", "port:=ehmi_display")

    def shows(state: Display) -> None:
        shown.wait(lambda message: json.loads(message.data)["state"] == state, f"{state.name} shown")

    peer.publish(topics.EHMI_STATE_COMMAND, EHMIState(state_num=Display.TRANSPORT, language="zh", volume=9))
    shows(Display.TRANSPORT)
    told = json.loads(shown.last.data)
    assert (told["text"], told["volume"], told["colour"]) == ("载客自动行驶中", 9, "turquoise")
    status.wait(lambda message: message.linked and message.acknowledged_state == Display.TRANSPORT, "acknowledged")
    bridge.stop()
    assert bridge.process.returncode == 0
    shows(Display.OFF)
    link = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"]) / "ehmi_display"
    assert link.is_symlink()
    display.stop()
    assert not link.is_symlink()
