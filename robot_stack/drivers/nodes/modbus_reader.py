"""The thread that polls a Modbus device: it connects, polls regularly, and reconnects if the device is lost."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from pymodbus import ModbusException
from pymodbus.client import ModbusSerialClient, ModbusTcpClient

from robot_stack.drivers.modbus.battery import Block
from robot_stack.drivers.modbus.params import ModbusParams

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


class _Lost(Exception):
    """An invalid response of the device. The message is one line."""


class ModbusReader:
    """Starts at once; ``close`` ends it. ``on_registers`` is called from its thread with the values by address.

    where: the device in words. serial_port: the path, if the transport is ``rtu``.
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
        self.state = f"{self.where} is not open yet"
        self.opened = 0
        self._log = _LastWords()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="modbus_reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Safe to call twice."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.is_set():
            client = self._client()
            try:
                if not client.connect():
                    raise _Lost(f"cannot be opened: {self._log.text}")
                self.opened += 1
                self.state = f"{self.where} is open"
                self._poll(client)
            except (ModbusException, OSError, _Lost) as error:
                self.state = f"{self.where}: {error}"
            finally:
                client.close()
            self._closing.wait(self._params.reopen_s)

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

    def _poll(self, client: Any) -> None:
        """Polls until the device is lost (an exception) or we close."""
        next_s, wanted = time.monotonic(), self._wanted
        while not self._closing.wait(max(0.0, next_s - time.monotonic())):
            next_s = max(next_s + self._params.poll_s, time.monotonic())
            answers = {block: self._ask(client, block) for block in wanted}
            # A device rejects a whole block with one register that it lacks: from then on each is requested separately.
            wanted = [one for block, answer in answers.items() for one in ([block] if answer else block.singles())]
            self._on_registers({address: value for answer in answers.values() for address, value in answer.items()})

    def _ask(self, client: Any, block: Block) -> dict[int, int]:
        """Empty if the device does not have these registers."""
        answer = client.read_holding_registers(block.first, count=block.size, device_id=self._params.unit)
        if answer.isError():
            code = getattr(answer, "exception_code", None)
            if code == _ILLEGAL_ADDRESS:
                return {}
            raise _Lost(f"register {block.first} is refused with exception {code}")
        if len(answer.registers) != block.size:
            raise _Lost(f"register {block.first}: {len(answer.registers)} values came, expected {block.size}")
        return dict(zip(range(block.first, block.first + block.size), answer.registers, strict=True))
