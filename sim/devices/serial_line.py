"""A serial cable: a pseudo terminal under a name that is constant over reconnections."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import struct
import termios
import tty
from pathlib import Path

from sim.devices.host import wait_read

_CHUNK = 4096


class SerialLine:
    """The device's end. link: path of the terminal for the host. Begins unplugged."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self._ends: tuple[int, int] | None = None  # the device's, the host's

    def plug(self) -> None:
        """The terminal appears; does nothing while it is there."""
        if self._ends is not None:
            return
        ours, theirs = pty.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        self._ends = ours, theirs
        fresh = self._link.with_name(f".{self._link.name}.{os.getpid()}")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(theirs))
        fresh.replace(self._link)

    def pull(self) -> None:
        """Removes the terminal; a process that has it open gets a hang-up."""
        if self._ends is None:
            return
        self._link.unlink(missing_ok=True)
        for end in self._ends:
            os.close(end)
        self._ends = None

    @property
    def ours(self) -> int | None:
        """The device's end, to wait for bytes of the host; None while unplugged."""
        return None if self._ends is None else self._ends[0]

    def send(self, data: bytes) -> None:
        """Sends bytes; a full or pulled line loses them, like a wire."""
        if self._ends is not None:
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], data)

    def received(self) -> bytes:
        """The bytes sent by the host."""
        if self._ends is None:
            return b""
        try:
            return os.read(self._ends[0], _CHUNK)
        except BlockingIOError:
            return b""

    def wait_read(self) -> bool:
        """Waits until the host has read all bytes. False, and the bytes are lost, if it does not read.

        The kernel hands over what was just sent a little later: call it before the next bytes.
        """
        if wait_read(self._unread):
            return True
        if self._ends is not None:
            termios.tcflush(self._ends[1], termios.TCIFLUSH)
        return False

    def _unread(self) -> int:
        if self._ends is None:
            return 0
        return int(struct.unpack("i", fcntl.ioctl(self._ends[1], termios.FIONREAD, bytes(4)))[0])
