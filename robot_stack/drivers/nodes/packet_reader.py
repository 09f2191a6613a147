"""The thread that owns a UDP socket."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable

_WAIT_S = 0.2
_BUFFER_BYTES = 4 * 2**20  # at least a third of a second, if the thread stalls
_LONGEST = 65536  # an Ouster of 128 beams sends 33 kB at once


class PacketReader:
    """Starts at once; ``close`` ends it. ``on_packet`` is called from its thread, only for packets of ``sender``.

    Raises OSError if the address cannot be bound.
    """

    def __init__(self, address: str, port: int, sender: str, on_packet: Callable[[bytes], None]) -> None:
        self._sender, self._on_packet = sender, on_packet
        self.of_others = 0
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        self._socket.bind((address, port))
        self._socket.settimeout(_WAIT_S)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="packet_reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Safe to call twice."""
        self._closing = True
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        while not self._closing:
            try:
                data, sender = self._socket.recvfrom(_LONGEST)
            except OSError:  # nothing came, or the network is down for now
                continue
            if sender[0] != self._sender:
                self.of_others += 1
                continue
            self._on_packet(data)
