"""The firmware of the simulated display. Pure: bytes and time in, bytes out; times are seconds of one steady clock."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from robot_stack.contract.display import Display as State
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Decoder, Kind
from sim.ehmi.params import FirmwareParams

_BYTE_S = 10.0 / 115200.0  # 8N1
_GARBAGE_S = 0.05
_GARBAGE_BYTES = 40
_GOODBYES = 3  # repetitions of the end of a fault, against lost lines


@dataclass(frozen=True, slots=True)
class Display:
    """The display's visible and audible state. since_s: begin of the state."""

    state: int
    language: str
    volume: int
    since_s: float


@dataclass(slots=True)
class Troubles:
    """Its present faults. late_s: added to every answer. fault: code, empty = none."""

    silent: bool = False
    garbage: bool = False
    half_lines: bool = False
    noise: float = 0.0
    late_s: float = 0.0
    fault: str = ""


@dataclass(slots=True)
class _Timer:
    due_s: float = math.inf
    left: int = field(default=0)


class Firmware:
    """Switched on by ``power_on``; until READY it ignores its input."""

    def __init__(self, params: FirmwareParams) -> None:
        self._params = params
        self._random = np.random.default_rng(params.seed)
        self.troubles = Troubles(noise=params.noise)
        self._fault_report = _Timer()
        self.boots = self.commands = 0
        self.power_on(-math.inf)
        self._ready_s = math.inf

    def power_on(self, now_s: float) -> None:
        """Restarts with cleared state."""
        self._decoder = Decoder()
        self._outbox: deque[tuple[float, bytes]] = deque()
        self._ready_s, self._ready_sent = now_s + self._params.boot_s, False
        self._received_s = self._garbage_s = -math.inf
        self._display = Display(State.OFF, "en", 0, now_s)
        self.boots += 1

    # --- received commands --------------------------------------------------------------------------------------------

    def set_fault(self, code: str, now_s: float) -> None:
        """An empty code ends the fault."""
        self.troubles.fault = code
        self._fault_report = _Timer(now_s, 0 if code else _GOODBYES)

    def receive(self, data: bytes, now_s: float) -> None:
        if now_s < self._ready_s:
            return
        refused = self._decoder.rejected.total()
        for line in self._decoder.feed(self._noisy(data)):
            self._on_line(line, now_s)
        if self._decoder.rejected.total() > refused:
            self._answer("ERROR not a line", now_s)

    def _on_line(self, line: str, now_s: float) -> None:
        command = codec.parse_command(line)
        if command is None:
            self._answer("ERROR unknown command", now_s)
            return
        self.commands += 1
        if command.kind is Kind.STATE:  # only a STATE command confirms the state
            self._received_s = now_s
        state, language, volume, since_s = self._commanded()
        match command.kind:
            case Kind.STATE if int(command.value) != state:
                state, since_s = int(command.value), now_s
            case Kind.LANGUAGE:
                language = command.value
            case Kind.VOLUME:
                volume = int(command.value)
            case _:
                pass
        self._display = Display(state, language, volume, since_s)
        self._answer(f"OK {command.text}", now_s)

    def _commanded(self) -> tuple[int, str, int, float]:
        display = self._display
        return display.state, display.language, display.volume, display.since_s

    # --- outputs ------------------------------------------------------------------------------------------------------

    def display(self, now_s: float) -> Display:
        """The present display; if the host is silent, an outdated intention must not remain on it."""
        display = self._display
        silent_s = self._received_s + self._params.host_timeout_s
        if display.state == State.OFF or now_s < silent_s:
            return display
        return Display(State.ERROR, display.language, display.volume, silent_s)

    def transmit(self, now_s: float) -> bytes:
        """The bytes that are sent by now."""
        if now_s < self._ready_s:
            return b""
        if not self._ready_sent:
            self._ready_sent = True
            self._answer("READY", now_s)
        self._report_fault(now_s)
        data = b""
        while self._outbox and self._outbox[0][0] <= now_s:
            data += self._outbox.popleft()[1]
        if self.troubles.silent:
            return b""
        if self.troubles.garbage and now_s >= self._garbage_s + _GARBAGE_S:
            self._garbage_s = now_s
            data += self._random.bytes(_GARBAGE_BYTES)
        return self._noisy(data)

    def next_due_s(self) -> float:
        """Time at which ``transmit`` is due next."""
        if not self._ready_sent:
            return self._ready_s
        due_s = min(self._fault_report.due_s, self._outbox[0][0] if self._outbox else math.inf)
        return min(due_s, self._garbage_s + _GARBAGE_S) if self.troubles.garbage else due_s

    def _report_fault(self, now_s: float) -> None:
        timer, code = self._fault_report, self.troubles.fault
        if now_s < timer.due_s:
            return
        timer.due_s = now_s + self._params.fault_repeat_s
        if not code:
            timer.left -= 1
            if timer.left <= 0:
                timer.due_s = math.inf
        self._answer(f"FAULT {code or codec.NO_FAULT}", now_s)

    def _answer(self, text: str, now_s: float) -> None:
        line = codec.encode(text)
        if self.troubles.half_lines:
            line = line[: len(line) // 2]
        params = self._params
        latency_s = params.latency_s + params.latency_jitter_s * float(self._random.random()) + self.troubles.late_s
        after_s = max(now_s, self._outbox[-1][0] if self._outbox else -math.inf)
        self._outbox.append((max(after_s, now_s + latency_s) + len(line) * _BYTE_S, line))

    def _noisy(self, data: bytes) -> bytes:
        if not data or self.troubles.noise <= 0.0:
            return data
        array = np.frombuffer(data, np.uint8).copy()
        hit = self._random.random(array.size) < self.troubles.noise
        array[hit] ^= self._random.integers(1, 256, int(hit.sum()), dtype=np.uint8)
        return array.tobytes()
