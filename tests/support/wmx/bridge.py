"""The engine bridge built against the stand-in of the vendor's library, and as a process on a simulated engine."""

from __future__ import annotations

import signal
import socket
import subprocess
from pathlib import Path

from robot_stack.core.cxx import cxx_compiler
from robot_stack.wmx.bridge import generate
from robot_stack.wmx.simulated.protocol import SOCKET_FILE
from tests.support.waiting import wait_for

FOLDER = generate.FOLDER
UNITS = ("bridge.cpp", "standin/standin.cpp")


def compiler() -> str:
    """The C++ compiler that the environment's set-up requires as well."""
    found = cxx_compiler()
    assert found is not None, "a C++ compiler is needed"
    return found


def build(folder: Path) -> Path:
    """Compiles the bridge into ``folder``. The units are compiled at the same time."""
    command = [compiler(), "-std=c++20", "-O1", "-pthread", "-Wall", "-Wextra", "-Werror"]
    command += ["-Wno-maybe-uninitialized", f"-I{FOLDER / 'standin'}"]  # GCC 12 misjudges std::variant
    objects = [folder / f"{Path(unit).stem}.o" for unit in UNITS]
    running = [
        subprocess.Popen([*command, "-c", str(FOLDER / unit), "-o", str(made)])
        for unit, made in zip(UNITS, objects, strict=True)
    ]
    assert [process.wait() for process in running] == [0] * len(UNITS)
    made = folder / "wmx_bridge"
    subprocess.run([*command, *map(str, objects), "-o", str(made)], check=True)
    return made


class BridgeProcess:
    """A bridge in ``folder`` on the engine in ``engine_folder``."""

    def __init__(
        self, program: Path, folder: Path, engine_folder: Path, axes: int, io_bytes: int, **options: int
    ) -> None:
        command = [str(program), "--folder", str(folder), "--root", str(engine_folder)]
        given = {"axes": axes, "io_bytes": io_bytes, **options}
        command += [word for name, value in given.items() for word in (f"--{name.replace('_', '-')}", str(value))]
        self._socket = folder / SOCKET_FILE
        self._socket.unlink(missing_ok=True)  # of a bridge that was killed
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        try:
            wait_for(self._listens, "the bridge to listen", 60.0)
        except BaseException:
            self.kill()
            raise

    def _listens(self) -> bool:
        assert self.process.poll() is None, f"the bridge ended: {self.process.communicate()[1]}"
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            return connection.connect_ex(str(self._socket)) == 0

    def stop(self) -> int:
        """Asks the bridge to end and returns its exit code."""
        self.process.send_signal(signal.SIGTERM)
        _, errors = self.process.communicate(timeout=30.0)
        assert errors == ""
        return self.process.returncode

    def kill(self) -> None:
        """Ends it at once, as a crash does."""
        self.process.kill()
        self.process.communicate()
