"""``robot-stack map teach``: records while staff drive, shows the growing map, and builds it at the end."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import sys
import time
from pathlib import Path
from queue import Empty
from types import FrameType

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.map_build import build_from_recordings, wanted
from robot_stack.cli.map_teach_picture import taught_picture, write_picture
from robot_stack.cli.map_teach_ride import TaughtRide
from robot_stack.cli.nodes.taught_topics import ROWS, TaughtTopics
from robot_stack.contract import topics
from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import recordings_dir
from robot_stack.mapping.params import MappingParams, Teach
from robot_stack.mapping.teaching import GrowingMap, status_line, warnings_of
from robot_stack.recording.background import BackgroundWriter
from robot_stack.recording.opening import need_room, open_recording, prepare_folder
from robot_stack.recording.params import RecorderParams
from robot_stack.supervisor.control import NotRunning, ask

Origin = tuple[float, float, float]

_LOOK_S = 0.1
# Nodes started without a supervisor are discovered within this time.
_DISCOVERY_S = 5.0
_SAFETY_S, _SAFETY_TIMEOUT_S = 2.0, 0.3
_WARN_AGAIN_S = 10.0
_NICE = 10  # the stack runs during the build
_INTERRUPTED = 130
_PICTURE = "growing.png"
# Sweeps that wait to be drawn.
_MOST_LATE = 10
_LATE = "this computer is slow: the picture lags behind, the recording does not"


def teach_map(
    name: str, output: Path | None, origin: Origin | None, recording: Path | None, picture: Path | None
) -> None:
    """Raises CommandError, ConfigError."""
    folder, start = wanted(name, output, origin)
    if folder.exists():
        raise CommandError(f"{folder} exists already: choose another name, or remove it", WRONG_USE)
    _need_writable(folder)
    if picture is not None and not picture.absolute().parent.is_dir():
        raise CommandError(f"{picture} cannot be written: there is no folder {picture.absolute().parent}", WRONG_USE)
    params, recorder = load(MappingParams, "mapping"), load(RecorderParams, "recorder")
    target = _recording_folder(name, recording, recorder)
    _make_room(target, recorder, own=recording is None)
    finish = _build_command(target, name, output, origin)
    with _Ending() as ending, TaughtTopics() as topics_in:
        _wait_for_inputs(topics_in, params.teach, ending)
        writer = open_recording(target, list(ROWS), recorder)
        try:
            shown = picture or target / _PICTURE
            growing = GrowingMap(params, start)
            write_picture(taught_picture(growing, params.grid.resolution_m, params.teach.picture_px), shown)
            print(f"recording: {target}")
            print(f"picture, redrawn every {params.teach.picture_s:g} s: {shown}")
            print(f"stand still for {params.teach.begin_s:g} s, then drive by hand; Ctrl-C ends the ride", flush=True)
            with TaughtRide(topics_in, writer, params.sweeps, load_robot(), params.teach) as ride:
                _watch(ride, writer, growing, params, shown, ending, finish)
        finally:
            writer.close()
        if writer.problem:
            raise CommandError(f"recording has stopped: {writer.problem}; to build the map so far: {finish}")
        print(f"the ride ends: {growing.driven_m:.1f} m, {ride.sweeps} sweeps; recorded in {target}")
        if ending.for_good:
            raise CommandError(f"ended; to build the map of this ride: {finish}", _INTERRUPTED)
    try:
        print("the map is built now, which may take minutes; Ctrl-C leaves the recording", flush=True)
        os.nice(_NICE)
        build_from_recordings([target], name, output, origin, plot=True)
    except KeyboardInterrupt:
        # An interrupted build leaves an incomplete map, which is invalid without its map.yaml.
        raise CommandError(f"interrupted; to build the map of this ride: {finish}", _INTERRUPTED) from None
    except CommandError as error:
        raise CommandError(f"{error}; the recording stays in {target}", error.code) from None


# --- before the ride -------------------------------------------------------------------------------------------------


def _need_writable(folder: Path) -> None:
    """Runs before the ride. Raises CommandError."""
    existing = next(parent for parent in folder.absolute().parents if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        raise CommandError(f"{folder} cannot be written: no right to write into {existing}")


def _recording_folder(name: str, chosen: Path | None, recorder: RecorderParams) -> Path:
    if chosen is None:
        when = time.strftime("%Y%m%d-%H%M%S", time.gmtime())
        return recordings_dir(recorder.output_folder) / f"teach-{name}-{when}"
    if chosen.exists():
        raise CommandError(f"{chosen} exists already: a recording needs a new folder", WRONG_USE)
    return chosen.absolute()


def _make_room(target: Path, recorder: RecorderParams, *, own: bool) -> None:
    """own: in the recorder's folder, where recordings of an earlier recorder are completed. Raises ConfigError."""
    if not own:
        need_room(target.parent, recorder.max_disk_use)
        return
    for line in prepare_folder(target.parent, recorder.max_disk_use):
        print(line)


def _build_command(recording: Path, name: str, output: Path | None, origin: Origin | None) -> str:
    """The command that builds the same map from the recording."""
    words = ["robot-stack", "map", "build", str(recording), "--name", name]
    words += ["--output", str(output.absolute())] if output is not None else []
    words += ["--origin", *map(str, origin)] if origin is not None else []
    return shlex.join(words)


def _wait_for_inputs(topics_in: TaughtTopics, settings: Teach, ending: _Ending) -> None:
    """Waits for points and odometry. Raises CommandError on timeout."""
    running = _stack_runs()
    missing = {topics.LIDAR_POINTS.name, topics.ODOM.name}
    begun_s = time.monotonic()
    while missing:
        missing -= {taken.row.name for taken in topics_in.take()}
        waited_s = time.monotonic() - begun_s
        if not running and waited_s > _DISCOVERY_S and not topics_in.published():
            domain = os.environ.get("ROS_DOMAIN_ID", "0")
            raise CommandError(f"no stack is running in ROS domain {domain}: robot-stack up starts it")
        if missing and waited_s > settings.points_within_s:
            raise CommandError(
                f"no message on {' and '.join(sorted(missing))} within {settings.points_within_s:g} s: "
                "robot-stack status and robot-stack topics show what is wrong"
            )
        if ending.asked:
            raise CommandError("ended before the ride", _INTERRUPTED)
        time.sleep(_LOOK_S)


def _stack_runs() -> bool:
    try:
        ask("status")
    except NotRunning:
        return False
    except TimeoutError:
        pass
    return True


# --- the ride --------------------------------------------------------------------------------------------------------


def _watch(
    ride: TaughtRide,
    writer: BackgroundWriter,
    growing: GrowingMap,
    params: MappingParams,
    picture: Path,
    ending: _Ending,
    finish: str,
) -> None:
    """Shows the growing map until the ride ends. Raises CommandError if reception fails."""
    settings, terminal = params.teach, _Terminal()
    line_s = picture_s = safety_s = time.monotonic()
    held: list[str] = []
    unseen: list[str] = []
    while not ending.asked and not writer.problem and ride.problem is None:
        _add(ride, growing, _LOOK_S)
        now_s = time.monotonic()
        if now_s >= safety_s:
            held, safety_s = _held_by_safety(), now_s + _SAFETY_S
        if now_s >= line_s:
            line_s = now_s + settings.line_s
            inputs = ride.inputs(writer.counts().lost)
            late = [_LATE] if ride.kept.qsize() > _MOST_LATE else []
            terminal.warn([*warnings_of(inputs, ride.motion, growing, settings), *held, *unseen, *late], now_s)
            terminal.line(status_line(growing))
        if now_s >= picture_s:
            unseen = _draw(growing, params, picture)
            picture_s = time.monotonic() + settings.picture_s
        time.sleep(_LOOK_S)
    ride.end()
    while not ride.kept.empty() and not ending.for_good:
        _add(ride, growing, _LOOK_S)
    _draw(growing, params, picture)
    terminal.line(status_line(growing))
    terminal.end()
    if isinstance(ride.problem, ValueError):
        raise CommandError(f"{ride.problem}; to build the map so far: {finish}")
    if ride.problem is not None:
        raise ride.problem


def _add(ride: TaughtRide, growing: GrowingMap, longest_s: float) -> None:
    """Adds newly kept sweeps within the time limit."""
    end_s = time.monotonic() + longest_s
    with contextlib.suppress(Empty):
        while time.monotonic() < end_s:
            growing.add(*ride.kept.get_nowait())


def _draw(growing: GrowingMap, params: MappingParams, picture: Path) -> list[str]:
    """Returns the reason if the picture cannot be written; this does not end a ride."""
    try:
        write_picture(taught_picture(growing, params.grid.resolution_m, params.teach.picture_px), picture)
    except CommandError as error:
        return [str(error)]
    return []


def _held_by_safety() -> list[str]:
    """The reason for a stop of the robot, from the supervisor's safety status."""
    try:
        safety = ask("safety", timeout_s=_SAFETY_TIMEOUT_S).get("safety")
    except (NotRunning, TimeoutError):
        return []
    if not safety:
        return []
    if safety["emergency"]:
        return ["emergency stop: the robot does not move until robot-stack reset"]
    if "LOCALIZATION_LOST" in safety["faults"]:
        return ["LOCALIZATION_LOST stops the robot: begin the stack without a map (docs/mapping.md)"]
    return []


class _Ending:
    """The first Ctrl-C ends the ride; after the block Ctrl-C works as usual.

    SIGTERM, or a second Ctrl-C before the recording is complete, ends the program: no map is built.
    """

    def __init__(self) -> None:
        self.asked = self.for_good = False

    def __enter__(self) -> _Ending:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.default_int_handler)

    def _on_signal(self, number: int, _: FrameType | None) -> None:
        self.for_good = self.asked or number == signal.SIGTERM
        self.asked = True


class _Terminal:
    """On a terminal, a new line replaces the previous one; elsewhere all lines are printed."""

    def __init__(self) -> None:
        self._own = sys.stdout.isatty()
        self._warned: dict[str, float] = {}

    def line(self, text: str) -> None:
        if self._own:
            print(f"\r\x1b[K{text[: shutil.get_terminal_size().columns - 1]}", end="", flush=True)
        else:
            print(text, flush=True)

    def warn(self, warnings: list[str], now_s: float) -> None:
        """Prints each warning when it is new, and periodically while it lasts."""
        self._warned = {text: said_s for text, said_s in self._warned.items() if text in warnings}
        for text in warnings:
            if now_s - self._warned.get(text, -_WARN_AGAIN_S) >= _WARN_AGAIN_S:
                self._warned[text] = now_s
                print(f"\r\x1b[Kwarning: {text}" if self._own else f"warning: {text}", flush=True)

    def end(self) -> None:
        if self._own:
            print()
