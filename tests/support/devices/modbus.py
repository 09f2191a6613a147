"""A Modbus device that answers reads of holding registers, byte by byte as the MODBUS application protocol 1.1b3 and
its guides for TCP and serial lines say; not by the library that asks it.
"""

from __future__ import annotations

import socket
import socketserver
import struct
import threading
from collections.abc import Mapping

_READ_HOLDING = 3
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS = 1, 2
_ERROR = 0x80
_MOST_REGISTERS = 125
_RTU_REQUEST_BYTES = 8
_POLYNOMIAL = 0xA001  # x16 + x15 + x2 + 1, reversed


class Registers:
    """Registers of a device of ``unit``, by address; a request to another unit is not answered."""

    def __init__(self, unit: int, values: Mapping[int, int]) -> None:
        self.unit, self.values = unit, dict(values)

    def answer(self, request: bytes) -> bytes:
        """PDU to PDU."""
        function = request[0]
        if function != _READ_HOLDING:
            return bytes([function | _ERROR, _ILLEGAL_FUNCTION])
        first, count = struct.unpack(">HH", request[1:5])
        addresses = range(first, first + count)
        if not 0 < count <= _MOST_REGISTERS or not all(address in self.values for address in addresses):
            return bytes([function | _ERROR, _ILLEGAL_ADDRESS])
        return struct.pack(f">BB{count}H", function, 2 * count, *(self.values[address] for address in addresses))

    def over_tcp(self, request: bytes) -> bytes:
        """A whole frame with its MBAP header to the answer's; empty if there is none."""
        transaction, protocol, length, unit = struct.unpack(">HHHB", request[:7])
        if protocol != 0 or unit != self.unit or length != len(request) - 6:
            return b""
        pdu = self.answer(request[7:])
        return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu

    def over_serial(self, request: bytes) -> bytes:
        """A whole RTU frame to the answer's; empty if it is not for this unit, or invalid."""
        if len(request) != _RTU_REQUEST_BYTES or request[0] != self.unit or crc(request[:-2]) != request[-2:]:
            return b""
        frame = bytes([self.unit]) + self.answer(request[1:-2])
        return frame + crc(frame)


def crc(frame: bytes) -> bytes:
    """The two bytes that end an RTU frame."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ _POLYNOMIAL if value & 1 else value >> 1
    return struct.pack("<H", value)


class TcpDevice:
    """Serves ``registers`` on the loopback until ``close``. port: of one that was there before, 0 for a free one.

    silent: requests are received and not answered.
    """

    def __init__(self, registers: Registers, port: int = 0) -> None:
        self.registers, self.silent = registers, False
        self._connections: set[socket.socket] = set()
        device = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                device._connections.add(self.connection)
                try:
                    while header := self.rfile.read(6):
                        frame = header + self.rfile.read(struct.unpack(">H", header[4:6])[0])
                        if not device.silent:
                            self.wfile.write(device.registers.over_tcp(frame))
                except OSError:  # who asked has gone
                    pass
                finally:
                    device._connections.discard(self.connection)

        class Server(socketserver.ThreadingTCPServer):
            allow_reuse_address = daemon_threads = True

        self._server = Server(("127.0.0.1", port), Handler)
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Closes all connections, as if the cable were pulled."""
        self._server.shutdown()
        self._server.server_close()
        for connection in tuple(self._connections):
            connection.close() if connection.fileno() < 0 else connection.shutdown(socket.SHUT_RDWR)
        self._thread.join()
