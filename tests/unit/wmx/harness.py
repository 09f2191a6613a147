"""Engines under test: one in a separate process, one in a thread with drives that a test can break."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from robot_stack.core.config import validate
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.api import AxisSelection, EngineState, ErrorCode
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ClientConfig, EngineConfig
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.protocol import SOCKET_FILE
from tests.support.waiting import wait_for

# Axes of the test engine: position and velocity mode, plain and mirrored, and one with an uneven gear.
POS, VEL, POS_MIRRORED, VEL_MIRRORED, POS_GEARED = range(5)
N_AXES = 5
POSITION_AXES = (POS, POS_MIRRORED, POS_GEARED)
VELOCITY_AXES = (VEL, VEL_MIRRORED)
QUICK_STOP_DEC = 200.0
ESTOP_DEC = 100.0
_SPEED = 4.0


def axis_kind(**changes: Any) -> dict[str, Any]:
    """Returns one kind of axis. Following errors are off unless a test sets them."""
    kind: dict[str, Any] = {
        "mode": "position",
        "gear_numerator": 131072.0,
        "gear_denominator": 6.283185307179586,
        "polarity": 1,
        "absolute_encoder": False,
        "home_offset_rad": 0.0,
        "in_pos_width_rad": 0.01,
        "pos_set_width_rad": 0.001,
        "quick_stop_dec_radps2": QUICK_STOP_DEC,
        "estop_dec_radps2": ESTOP_DEC,
        "servo_off_during_alarm": True,
        "following_error": {
            "moving_rad": 0.0,
            "stopped_rad": 0.0,
            "velocity_moving_radps": 0.0,
            "velocity_stopped_radps": 0.0,
            "velocity_time_s": 0.0,
            "quick_stop": True,
        },
        "soft_limits": None,
    }
    return {**kind, **changes}


def engine_data(**changes: Any) -> dict[str, Any]:
    """The test engine's configuration as a mapping."""
    kinds = {
        "pos": axis_kind(),
        "vel": axis_kind(mode="velocity"),
        "pos_mirrored": axis_kind(polarity=-1, absolute_encoder=True, home_offset_rad=0.5),
        "vel_mirrored": axis_kind(mode="velocity", polarity=-1),
        "pos_geared": axis_kind(gear_numerator=52953088.0),
    }
    data: dict[str, Any] = {
        "cycle_time_s": 0.001,
        "n_input_bytes": 4,
        "n_output_bytes": 4,
        "quit_without_devices": True,
        "estop_servo_off": False,
        "estop_signal": {"enabled": False, "byte": 0, "bit": 0, "active": 0, "level": "level1"},
        "timing": {
            "servo_on_delay_cycles": 5,
            "clear_alarm_cycles": 10,
            "communication_start_cycles": 10,
            "bus_lost_cycles": 20,
            "shutdown_cycles": 5,
        },
        "server": {
            "create_device_s": 0.0,
            "pause_publish_s": 0.02,
            "max_clients": 64,
            "shutdown_stop_s": 2.0,
        },
        "kinds": kinds,
        "axes": [{"name": name, "kind": name} for name in kinds],
    }
    return {**data, **changes}


def engine_config(**changes: Any) -> EngineConfig:
    """The test engine's configuration."""
    return validate(EngineConfig, engine_data(**changes), "test")


def client_config(folder: Path) -> ClientConfig:
    """Returns a client configuration with timeouts for a loaded machine."""
    data = {
        "engine": "simulated",
        "path": str(folder),
        "library_path": "",
        "call_timeout_s": 10.0,
        "status_stale_s": 2.0,
        "connect_timeout_s": 20.0,
        "lock_retry_s": 0.01,
        "vendor_axes": 8,
        "vendor_io_bytes": 8,
    }
    return validate(ClientConfig, data, "test")


@contextmanager
def runtime_folder() -> Iterator[Path]:
    """Yields a folder with a short path, since the path of a socket is limited."""
    folder = Path(tempfile.mkdtemp(prefix="wmx-", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else "/tmp"))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Harness:
    """A running engine and the clients of one test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config = client_config(folder)
        self._clients: list[MotionEngine] = []

    def connect(self, name: str = "test") -> MotionEngine:
        """Returns a client that is closed with the test."""
        client = connect(name, self.config)
        self._clients.append(client)
        return client

    def communicating(self, name: str = "test") -> MotionEngine:
        """Returns a client of a communicating engine, servos off."""
        client = self.connect(name)
        assert client.api.StartCommunication(20000) == ErrorCode.PyNone
        return client

    def ready(self, name: str = "test") -> MotionEngine:
        """Returns a client of a communicating engine, all servos on, positions set to 0."""
        client = self.communicating(name)
        all_axes = AxisSelection.of(*range(N_AXES))
        assert client.core_motion.axisControl.SetServoOn_AxisSel(all_axes, 1) == ErrorCode.PyNone
        wait_for(lambda: status(client).servo_on.all(), "all servos on", poll_s=0.001)
        for axis in POSITION_AXES:  # positions start at 0, wherever the previous test left the drives
            assert client.core_motion.home.SetCommandPos(axis, 0.0) == ErrorCode.PyNone
        return client

    def raw_socket(self) -> socket.socket:
        """Returns a connection without a client behind it."""
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.connect(str(self.folder / SOCKET_FILE))  # blocks until the queue has room
        connection.settimeout(20.0)
        return connection

    def end_test(self) -> None:
        """Restores the initial state of the engine: idle, without devices."""
        stopper = next((client for client in self._clients if client.api.IsDeviceValid()), None)
        if stopper is None:
            stopper = connect("cleaner", self.config)
        stopper.api.StopEngine(20000)
        for client in self._clients:
            client.close()
        self._clients.clear()


class ProcessHarness(Harness):
    """The engine in a separate process, on virtual drives, faster than real time."""

    def __init__(self, folder: Path, stale_socket: bool = False) -> None:
        super().__init__(folder)
        self._not_before_ns = time.time_ns() if stale_socket else 0
        configuration = folder / "engine.yaml"
        configuration.write_text(yaml.safe_dump(engine_data()), encoding="utf-8")
        command = [sys.executable, "-m", "robot_stack.wmx.engine_server", "--speed", str(_SPEED)]
        command += ["--config", str(configuration), "--runtime-dir", str(folder)]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        wait_for(self._listens, "the engine process to listen", 60.0)

    def _listens(self) -> bool:
        assert self.process.poll() is None, f"the engine process ended: {self.process.communicate()[1]}"
        path = self.folder / SOCKET_FILE
        return path.exists() and path.stat().st_ctime_ns >= self._not_before_ns

    def close_pipes(self) -> None:
        """Closes the pipes of a killed process."""
        if self.process.stderr is not None:
            self.process.stderr.close()

    def stop(self) -> int:
        """Asks the engine to end and returns its exit code."""
        self.process.send_signal(signal.SIGTERM)
        _, errors = self.process.communicate(timeout=30.0)
        assert errors == ""
        return self.process.returncode


class ThreadHarness(Harness):
    """The engine in a thread of the test, with access to drives and server. Paced like the real one."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        super().__init__(folder)
        config = engine_config(**changes)
        self.drives = VirtualDrives(config.n_axes, config.cycle_time_s)
        self.engine = Engine(config, self.drives)
        self.server = EngineServer(self.engine, folder)
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=self.server.serve_forever, args=(self._ended.is_set, _SPEED), name="engine", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread, then the server."""
        self._ended.set()
        self._thread.join(30.0)
        assert not self._thread.is_alive()
        self.server.close()


@contextmanager
def engine_in_thread(**changes: Any) -> Iterator[ThreadHarness]:
    """Yields an engine in its own folder. changes: of its configuration."""
    with runtime_folder() as folder:
        harness = ThreadHarness(folder, **changes)
        try:
            yield harness
        finally:
            harness.stop()


def part(engine: MotionEngine, owner: str) -> Any:
    """Returns the port's object for a name of the surface."""
    whole = {"WMX3Api": engine.api, "CoreMotion": engine.core_motion, "Io": engine.io, "Ecat": engine.ecat}
    if owner in whole:
        return whole[owner]
    return engine.advanced_motion.advMotion if owner == "advMotion" else getattr(engine.core_motion, owner)


def status(client: MotionEngine) -> StatusSnapshot:
    """Returns the current status, which must be readable."""
    code, snapshot = client.read_status()
    assert code == ErrorCode.PyNone
    return snapshot


def wait_status(client: MotionEngine, holds: Callable[[StatusSnapshot], Any], what: str) -> StatusSnapshot:
    """Waits for and returns the first status for which ``holds``."""

    def read() -> StatusSnapshot | None:
        snapshot = status(client)
        return snapshot if holds(snapshot) else None

    found = wait_for(read, what, poll_s=0.0005)
    assert found is not None
    return found


def wait_idle(client: MotionEngine, *axes: int) -> StatusSnapshot:
    """Waits for and returns the first status in which the axes are idle."""
    return wait_status(client, lambda now: not now.op_state[list(axes)].any(), f"rest of {axes}")


def some_cycles(client: MotionEngine, count: int = 5) -> StatusSnapshot:
    """Returns the status after at least ``count`` further cycles."""
    start = status(client).cycle_counter
    return wait_status(client, lambda now: now.cycle_counter >= start + count, f"{count} cycles")


def engine_state(folder: Path) -> EngineState:
    """Returns the engine's own state, without a device."""
    return StatusView(folder, 5.0).read()[1].engine_state
