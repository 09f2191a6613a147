"""The line to the external display: acknowledge, pulled cables, lost states, corrupt frames that got through."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from robot_stack.contract.display import LANGUAGES
from robot_stack.core.config import load
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Decoder
from robot_stack.ehmi.link import Shown
from robot_stack.ehmi.nodes.serial_port import SerialPort
from robot_stack.ehmi.params import EhmiParams
from sim.ehmi.line import DisplayLine
from sim.ehmi.params import EhmiDisplayParams
from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile

AIMS = {
    "state_to_ack_ms_p99": Aim("<", 100.0),
    "recovered_links": Aim(">=", 100.0),
    "states_lost": Aim("<=", 0.0),
    "corrupt_frames_accepted": Aim("<=", 0.0),
}
_DEADLINE_S = 15.0
_POLL_S = 0.0005
_STATES = sorted(codec.STATES)
_MOST_CHANGES = 4


class _Rig:
    """The bridge's port connected to the simulated firmware over a pseudo terminal."""

    def __init__(self, folder: Path) -> None:
        self.bridge = load(EhmiParams, "ehmi_bridge")
        self.display = load(EhmiDisplayParams, "ehmi_display")
        link = folder / self.display.link_name
        self.line = DisplayLine(self.display.firmware, link)
        self.wanted = Shown(1, self.bridge.language, self.bridge.volume)
        self.port = SerialPort(str(link), self.bridge.baud_rate, self.bridge.link, self.wanted)
        self.random = np.random.default_rng(self.display.firmware.seed)

    def close(self) -> None:
        self.port.close()
        self.line.close()

    def show_another(self) -> None:
        others = [state for state in _STATES if state != self.wanted.state]
        self.wanted = Shown(int(self.random.choice(others)), self.bridge.language, self.bridge.volume)
        self.port.show(self.wanted)

    def acknowledged(self) -> bool:
        status = self.port.status()
        return status.linked and status.acknowledged_state == self.wanted.state

    def shown(self) -> bool:
        return self.acknowledged() and self.line.display().state == self.wanted.state


def _within(condition: Callable[[], bool], limit_s: float = _DEADLINE_S) -> bool:
    end_s = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > end_s:
            return False
        time.sleep(_POLL_S)
    return True


def run(states: int = 1000, pulls: int = 100, frames: int = 100_000) -> Result:
    """states: timed state changes. pulls: cable disconnections. frames: corrupted ones, half sent to the display."""
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        rig = _Rig(Path(folder))
        try:
            if not _within(rig.acknowledged):
                raise BenchError(f"the simulated display does not answer: {rig.port.status().text}")
            ack_ms, lost = _changes(rig, states)
            recovered, recovery_s, lost_by_pulls = _pulls(rig, pulls)
        finally:
            rig.close()
    accepted = _corrupt_frames(frames, rig.display.firmware.seed)
    figures = {
        "state_to_ack_ms_p50": percentile(ack_ms, 0.50),
        "state_to_ack_ms_p99": percentile(ack_ms, 0.99),
        "recovered_links": 100.0 * recovered / pulls,
        "recovery_s_p50": percentile(recovery_s, 0.50),
        "recovery_s_max": max(recovery_s, default=float("nan")),
        "states_lost": float(lost + lost_by_pulls),
        "corrupt_frames_accepted": float(accepted),
    }
    return Result(
        figures,
        {
            "states": states,
            "pulls": f"{pulls}, out for 0 to 0.6 s, the state changed meanwhile; every second one without power too",
            "recovered_links": "per 100 pulls",
            "frames": f"{frames}, 1 to {_MOST_CHANGES} bytes changed; accepted: read as another command or answer",
            "display": f"simulated firmware on a pty, noise {rig.display.firmware.noise:g} of all bytes, answers after "
            f"{1e3 * rig.display.firmware.latency_s:g} to "
            f"{1e3 * (rig.display.firmware.latency_s + rig.display.firmware.latency_jitter_s):g} ms",
        },
    )


def _changes(rig: _Rig, count: int) -> tuple[list[float], int]:
    times_ms, lost = [], 0
    for _ in range(count):
        rig.show_another()
        if not _within(rig.shown):
            lost += 1
            continue
        times_ms.append(1e3 * rig.port.status().state_to_ack_s)
    return times_ms, lost


def _pulls(rig: _Rig, count: int) -> tuple[int, list[float], int]:
    """Counts links that recovered, measures the recovery times, and counts states not shown after recovery."""
    recovered, times_s, lost = 0, [], 0
    for number in range(count):
        rig.line.pull()
        if not _within(lambda: not rig.port.status().linked):
            raise BenchError("the bridge does not detect a pulled cable")
        rig.show_another()
        time.sleep(float(rig.random.uniform(0.0, 0.6)))
        if number % 2:
            rig.line.with_firmware(lambda firmware, now_s: firmware.power_on(now_s))
        rig.line.plug()
        begun_s = time.monotonic()
        linked = _within(lambda: rig.port.status().linked)
        recovered += linked
        if linked:
            times_s.append(time.monotonic() - begun_s)
        lost += not _within(rig.shown)
    return recovered, times_s, lost


def _corrupt_frames(count: int, seed: int) -> int:
    """Counts corrupted frames that were decoded as a frame other than the one sent."""
    random = np.random.default_rng(seed)
    commands = [
        *(codec.state_command(state) for state in _STATES),
        *(codec.language_command(language) for language in LANGUAGES),
        *(codec.volume_command(volume) for volume in range(codec.HIGHEST_VOLUME + 1)),
    ]
    accepted = 0
    for number in range(count):
        command = commands[int(random.integers(len(commands)))]
        answers = bool(number % 2)
        frame = np.frombuffer(codec.encode(f"OK {command.text}" if answers else command.text), np.uint8).copy()
        places = random.choice(frame.size, int(random.integers(1, _MOST_CHANGES + 1)), replace=False)
        frame[places] ^= random.integers(1, 256, places.size, dtype=np.uint8)
        for text in Decoder().feed(frame.tobytes() + b"\n"):
            said = codec.parse_answer(text) if answers else codec.parse_command(text)
            accepted += said not in (None, codec.Ok(command) if answers else command)
    return accepted
