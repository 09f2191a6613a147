"""A Modbus device: polls its registers regularly."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from robot_stack.drivers.modbus.battery import Block
from robot_stack.drivers.modbus.params import ModbusParams
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread

_ILLEGAL_ADDRESS = 2  # MODBUS application protocol 1.1b3, section 7


class _LastWords(logging.Handler):
    """Keeps pymodbus's last log message: it reports the reason of a failed open only in its log."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.text = ""
        log = logging.getLogger("pymodbus.logging")
        log.propagate = False  # not to the console each time: ``state`` shows it
        log.addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        if not record.getMessage().startswith("Repeating"):  # its form of a repeated message
            self.text = record.getMessage()


class ModbusUnit:
    """``on_registers`` is called from the device's thread with the values by address.

    serial_port: the path, if the transport is ``rtu``.
    """

    def __init__(
        self,
        params: ModbusParams,
        serial_port: str,
        wanted: Sequence[Block],
        on_registers: Callable[[dict[int, int]], None],
    ) -> None:
        self._params, self._serial_port, self._wanted, self._on_registers = params, serial_port, wanted, on_registers
        self.where = f"{params.host}:{params.port}" if params.transport == "tcp" else serial_port
        self._log = _LastWords()

    def use(self, thread: DeviceThread) -> None:
        client = self._client()
        try:
            if not client.connect():
                raise DeviceLost(f"cannot be opened: {self._log.text}")
            thread.report_open()
            self._poll(client, thread)
        finally:
            client.close()

    def _client(self) -> Any:
        params = self._params
        if params.transport == "tcp":
            return ModbusTcpClient(params.host, port=params.port, timeout=params.timeout_s, retries=0)
        return ModbusSerialClient(
            self._serial_port,
            baudrate=params.baud_rate,
            parity=params.parity[0].upper(),
            stopbits=2 if params.parity == "none" else 1,  # MODBUS over serial line 1.02: always 11 bits
            timeout=params.timeout_s,
            retries=0,
        )

    def _poll(self, client: Any, thread: DeviceThread) -> None:
        next_s, wanted = time.monotonic(), self._wanted
        while thread.running:
            next_s = max(next_s + self._params.poll_s, time.monotonic())
            answers = {block: self._ask(client, block) for block in wanted}
            # A device rejects a whole block with one register that it lacks: from then on each is requested separately.
            wanted = [one for block, answer in answers.items() for one in ([block] if answer else block.singles())]
            self._on_registers({address: value for answer in answers.values() for address, value in answer.items()})
            thread.wait(max(0.0, next_s - time.monotonic()))

    def _ask(self, client: Any, block: Block) -> dict[int, int]:
        """Empty if the device does not have these registers."""
        answer = client.read_holding_registers(block.first, count=block.size, device_id=self._params.unit)
        if answer.isError():
            code = getattr(answer, "exception_code", None)
            if code == _ILLEGAL_ADDRESS:
                return {}
            raise DeviceLost(f"rejects register {block.first} with exception {code}")
        if len(answer.registers) != block.size:
            raise DeviceLost(f"sends {len(answer.registers)} values from register {block.first}, expected {block.size}")
        return dict(zip(range(block.first, block.first + block.size), answer.registers, strict=True))
