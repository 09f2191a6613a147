"""A camera behind the kernel's V4L2 interface, which the library ``v4l2_camera.cpp`` answers where it is preloaded."""

from __future__ import annotations

import contextlib
import fcntl
import os
import socket
import struct
import subprocess
import termios
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_stack.core.cxx import cxx_compiler
from sim.devices.host import wait_read

CAMERAS_VARIABLE = "V4L2_CAMERAS"
"""The folder whose files the library takes for cameras."""
_QUALITY = 80  # of its JPEG, so that a frame fits into a socket's default buffer
_SOURCE = Path(__file__).with_name("v4l2_camera.cpp")


def build_library(folder: Path) -> Path:
    """Compiles the library into ``folder``. Raises OSError without a C++ compiler."""
    compiler = cxx_compiler()
    if compiler is None:
        raise OSError("no C++ compiler is installed, which the simulated V4L2 cameras need")
    library = folder / "v4l2_camera.so"
    subprocess.run([compiler, "-std=c++17", "-O2", "-shared", "-fPIC", "-o", library, _SOURCE, "-ldl"], check=True)
    return library


class V4l2Camera:
    """The camera's end: a socket in the place of the device's file. Sends JPEG, each frame with its timestamp."""

    def __init__(self, file: Path) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.unlink(missing_ok=True)
        self._file = file
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._server.bind(str(file))
        self._server.listen()
        self._server.setblocking(False)
        self._host: socket.socket | None = None

    def send(self, pixels: NDArray[np.uint8], begin_s: float) -> None:
        """pixels: (height, width) brightness. begin_s: the start of the first row's exposure by the host's clock.

        A frame that no program wants is lost.
        """
        with contextlib.suppress(BlockingIOError):
            self._host = self._server.accept()[0]
        if self._host is None:
            return
        _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        try:
            self._host.setblocking(False)
            self._host.sendmsg([struct.pack("<q", round(1e6 * begin_s)), data.tobytes()])
            wait_read(self._unread)
        except BlockingIOError:  # the host has not read the frames before
            pass
        except OSError:
            self._host.close()
            self._host = None

    def close(self) -> None:
        self._file.unlink(missing_ok=True)
        self._server.close()
        if self._host is not None:
            self._host.close()

    def _unread(self) -> int:
        """Raises OSError if the host has gone."""
        assert self._host is not None
        answer = fcntl.ioctl(self._host, termios.TIOCOUTQ, bytes(4))
        return int(struct.unpack("i", answer)[0])


def environment(library: Path, folder: Path) -> dict[str, str]:
    """For programs that open the cameras in ``folder``."""
    before = os.environ.get("LD_PRELOAD")
    return {"LD_PRELOAD": f"{library}:{before}" if before else str(library), CAMERAS_VARIABLE: str(folder)}
