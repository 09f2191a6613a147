"""The latch on the motion engine's I/O, followed in a thread of its own."""

from __future__ import annotations

import threading

from robot_stack.core.robot import Latch
from robot_stack.docking.latch import LatchCommand, LatchInputs
from robot_stack.middleware.node import StackNode
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView

_UNKNOWN = LatchInputs()


class LatchIo:
    """``inputs`` are the newest; ``command`` is what the outputs shall be, repeated until the engine has it."""

    def __init__(self, node: StackNode, poll_hz: float) -> None:
        self._latch: Latch = node.robot.latch
        self._turn = threading.Lock()
        self._inputs = _UNKNOWN
        self._command = LatchCommand.HOLD
        self._problem = ""
        self._view = node.device(EngineView, node.get_name(), poll_hz, self._on_status)
        self._view.start()

    @property
    def inputs(self) -> LatchInputs:
        with self._turn:
            return self._inputs

    @property
    def problem(self) -> str:
        """What the engine answered to the last command that it refused, else an empty text."""
        with self._turn:
            return self._problem

    def command(self, command: LatchCommand) -> None:
        with self._turn:
            self._command = command

    def close(self) -> None:
        """Leaves the latch as it is and gives the device back."""
        self.command(LatchCommand.HOLD)
        self._view.close()

    def _on_status(self, status: StatusSnapshot | None) -> None:
        known = status is not None and status.communicating
        inputs = self._read(status) if status is not None and known else _UNKNOWN
        with self._turn:
            self._inputs, command = inputs, self._command
        if status is not None and known:
            problem = self._write(status, command)
            with self._turn:
                self._problem = problem

    def _read(self, status: StatusSnapshot) -> LatchInputs:
        latch = self._latch
        return LatchInputs(
            True,
            status.input_bit(latch.byte, latch.closed_input_bit),
            status.input_bit(latch.byte, latch.open_input_bit),
        )

    def _write(self, status: StatusSnapshot, command: LatchCommand) -> str:
        """Sets what differs. Off before on: never are both on, not even for a cycle."""
        engine, latch = self._view.engine, self._latch
        if engine is None:
            return ""
        wanted = (
            (latch.close_output_bit, int(command is LatchCommand.CLOSE)),
            (latch.open_output_bit, int(command is LatchCommand.OPEN)),
        )
        for bit, value in sorted(wanted, key=lambda item: item[1]):
            if status.output_bit(latch.byte, bit) == bool(value):
                continue
            code = engine.io.SetOutBit(latch.byte, bit, value)
            if code:
                return f"output {latch.byte}.{bit}: {engine.io.ErrorToString(code)} (error {code})"
        return ""
