"""The latch on the motion engine's I/O, in a separate thread."""

from __future__ import annotations

import threading

from robot_stack.core.robot import Latch
from robot_stack.docking.latch import LatchCommand, LatchInputs
from robot_stack.middleware.node import StackNode
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView

_UNKNOWN = LatchInputs()


class LatchIo:
    """``inputs`` are the newest; ``command`` sets the outputs, repeated until the engine has them."""

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
        """The engine's answer to the last rejected command, else an empty text."""
        with self._turn:
            return self._problem

    def command(self, command: LatchCommand) -> None:
        with self._turn:
            self._command = command

    def close(self) -> None:
        """Leaves the latch unchanged and closes the device."""
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
        """Sets the outputs that differ. Off before on: both are never on, not even for a cycle."""
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
