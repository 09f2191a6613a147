"""The UDP socket that receives a device's packets."""

from __future__ import annotations

import socket
from collections.abc import Callable

from robot_stack.middleware.device_thread import DeviceThread

_BUFFER_BYTES = 4 * 2**20  # at least a third of a second, if the thread stalls
_LONGEST = 65536  # an Ouster of 128 beams sends 33 kB at once


class UdpSocket:
    """``on_packet`` is called from the device's thread, only for packets of ``sender``.

    The socket stays bound if the network is down.

    Raises OSError if the address cannot be bound.
    """

    def __init__(self, address: str, port: int, sender: str, on_packet: Callable[[bytes], None]) -> None:
        self.where = f"{address} port {port}"
        self._sender, self._on_packet = sender, on_packet
        self.of_others = 0
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.bind((address, port))
        self._socket.setblocking(False)

    def close(self) -> None:
        """Call after the thread has ended."""
        self._socket.close()

    def use(self, thread: DeviceThread) -> None:
        thread.report_open()
        while thread.running:
            if thread.wait(None, self._socket):
                self._receive()

    def _receive(self) -> None:
        data, sender = self._socket.recvfrom(_LONGEST)
        if sender[0] == self._sender:
            self._on_packet(data)
        else:
            self.of_others += 1
