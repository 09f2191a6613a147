"""The network interface of a device: sends packets to a port of this computer, and waits until they are read."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from pathlib import Path

from sim.devices.host import wait_read

ADDRESS = "127.0.0.1"
_TOGETHER = 8  # packets sent at once: fewer than a receiver's default buffer holds
_SOCKETS = Path("/proc/net/udp")  # the kernel's table, proc(5): local address and port, queues, in hexadecimal


def free_port() -> int:
    """A port of this computer that no socket uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind((ADDRESS, 0))
        return int(free.getsockname()[1])


class UdpSender:
    """port: destination. absent: packets are lost, because no process reads them."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((ADDRESS, 0))
        self.absent = False

    def send(self, packets: Iterable[bytes]) -> None:
        for number, packet in enumerate(packets, 1):
            self._socket.sendto(packet, (ADDRESS, self._port))
            if number % _TOGETHER == 0 and not self.absent:
                self.absent = not wait_read(self.unread)
        self.absent = not wait_read(self.unread) if not self.absent else self.unread() > 0

    def unread(self) -> int:
        """Bytes that wait in the sockets of the port."""
        found = 0
        for line in _SOCKETS.read_text(encoding="ascii").splitlines()[1:]:
            fields = line.split()
            if int(fields[1].rpartition(":")[2], 16) == self._port:
                found += int(fields[4].rpartition(":")[2], 16)
        return found

    def close(self) -> None:
        self._socket.close()
