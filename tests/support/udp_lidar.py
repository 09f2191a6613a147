"""A LiDAR on the loopback interface that sends due packets by its own clock."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

from tests.support.peer import Received, says
from tests.support.waiting import wait_for


class UdpLidar:
    """packet: the bytes of the n-th packet, one every ``packet_s``. sends: False simulates a pulled cable.

    extra: sent once, between two packets. port: destination port, chosen from the free ports.
    """

    IP = "127.0.0.1"

    def __init__(self, packet: Callable[[int], bytes], packet_s: float) -> None:
        self.packet, self._packet_s = packet, packet_s
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((self.IP, 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind((self.IP, 0))
            self.port = free.getsockname()[1]
        self.sends, self.extra = True, b""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        begin_s, number = time.monotonic(), 0
        while not self._ended.wait(0.005):
            due = int((time.monotonic() - begin_s) / self._packet_s)
            while number < due:
                if self.sends:
                    self._socket.sendto(self.packet(number), (self.IP, self.port))
                number += 1
            if self.extra:
                self._socket.sendto(self.extra, (self.IP, self.port))
                self.extra = b""

    def damage(self, data: bytes, diagnostics: Received, driver: str) -> None:
        """Sends corrupt data until the driver reports it: without processor time, it loses packets."""

        def counted() -> int:
            return int(says(diagnostics, driver, "")["packets corrupt"])

        def reported() -> bool:
            self.extra = data
            return counted() > before

        before = counted()
        wait_for(reported, "a corrupt packet")

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._socket.close()
