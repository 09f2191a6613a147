"""The recording of a demonstration's ride, and the film that is made from it."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from robot_stack.cli.errors import CommandError
from robot_stack.cli.film import make_film
from robot_stack.core.config import ConfigError, load
from robot_stack.film.params import FilmParams

# Topics of high bandwidth that neither plots nor film need.
_LEFT_OUT = ("/sensors/lidar/*", "/sensors/overhead_lidar/*", "/sensors/camera/*", "/perception/*", "/local_costmap/*")
_FINISH_S = 15.0


class Recording:
    """``robot-stack record`` beside the ride, in a folder of its own below ``folder``. The stack must run."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "recording"
        left_out = [part for pattern in _LEFT_OUT for part in ("--exclude", pattern)]
        command = [sys.executable, "-m", "robot_stack.cli", "record", "--output", str(folder), "--name", "recording"]
        with open(folder / "recorder.log", "wb") as log:
            self._process = subprocess.Popen([*command, *left_out], stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def under_way(self) -> bool:
        """True once it records, or has ended without recording."""
        return any(self.path.glob("*.mcap")) or self._process.poll() is not None

    def finish(self) -> None:
        """Completes the recording; one that is incomplete after the timeout is readable up to its end."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_FINISH_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def film_of(recording: Path, file: Path, map_name: str) -> str:
    """Draws the film. Returns why there is none, else an empty text."""
    try:
        make_film(recording, [file], load(FilmParams, "film"), map_name, report=lambda _: None)
    except (CommandError, ConfigError) as error:
        return str(error)
    return ""
