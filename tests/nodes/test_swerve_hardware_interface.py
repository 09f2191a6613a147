"""The shutdown of the hardware interface's process on a real engine process. Its behaviour: tests/simulated/nodes."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from custom_msgs.msg import SafetyStatus, SwerveModuleCommand, SwerveModuleCommandArray
from robot_stack.contract import topics
from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.protocol import SOCKET_FILE
from tests.support.peer import Peer
from tests.support.processes import ROOT, NodeProcess
from tests.support.waiting import DEADLINE_S, wait_for

ROBOT = load_robot()
RADIUS_M = ROBOT.wheel_radius_m
WELL = {"safety_state": SafetyStatus.NORMAL}


def wheel_commands(speed_mps: float) -> SwerveModuleCommandArray:
    return SwerveModuleCommandArray(
        modules=[SwerveModuleCommand(module_id=i, drive_velocity=speed_mps) for i in range(4)]
    )


class Rig:
    """Engine, node, and the node's inputs."""

    def __init__(self, start: Callable[..., NodeProcess], peer: Peer, folder: Path) -> None:
        self.start, self.peer = start, peer
        self.orders = folder / "orders.json"
        self.engine: NodeProcess | None = None
        self.node: NodeProcess | None = None
        self.device: MotionEngine | None = None

    def start_engine(self) -> NodeProcess:
        not_before_ns = time.time_ns()
        script = ROOT / "tests" / "nodes" / "scripts" / "engine_process.py"
        self.engine = self.start("engine", command=[sys.executable, str(script), str(self.orders)])
        socket = runtime_dir() / SOCKET_FILE
        wait_for(lambda: socket.exists() and socket.stat().st_ctime_ns >= not_before_ns, "the engine to listen", 60.0)
        return self.engine

    def start_node(self, *ros_args: str) -> NodeProcess:
        self.node = self.start("swerve_hardware_interface", *ros_args)
        for row in (topics.WHEEL_COMMANDS, topics.SAFETY_STATUS, topics.EMERGENCY_STOP):
            self.peer.wait_matched(row)
        return self.node

    def safety(self, fields: dict[str, object]) -> None:
        self.peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(**fields), 10.0)

    def command(self, speed_mps: float) -> None:
        self.peer.repeat(topics.WHEEL_COMMANDS, lambda: wheel_commands(speed_mps), 20.0)

    # The engine's status, read without the node.

    def status(self) -> StatusSnapshot:
        return StatusView(runtime_dir(), 5.0).read()[1]

    def wait_status(self, holds: Callable[[StatusSnapshot], object], what: str) -> StatusSnapshot:
        view = StatusView(runtime_dir(), 5.0)

        def look() -> StatusSnapshot | None:
            code, snapshot = view.read()
            return snapshot if not code and snapshot.n_axes and holds(snapshot) else None

        found = wait_for(look, what, poll_s=0.001)
        assert found is not None
        return found

    def wait_servos(self, on: bool = True) -> None:
        self.wait_status(lambda s: (s.servo_on == on).all(), f"all servos {'on' if on else 'off'}")

    def wait_speed(self, speed_mps: float) -> None:
        """Waits until all four wheels turn at this speed."""
        self.wait_status(lambda s: (abs(wheels_mps(s) - speed_mps) < 0.01).all(), f"wheels at {speed_mps} m/s")

    def ready(self) -> None:
        self.start_engine()
        self.safety(WELL)
        self.start_node()
        self.command(0.0)
        self.wait_servos()


def wheels_mps(snapshot: StatusSnapshot):
    return snapshot.actual_velocity[list(DRIVE_AXES)] * RADIUS_M


def wheels_m(snapshot: StatusSnapshot):
    return snapshot.actual_pos[list(DRIVE_AXES)] * RADIUS_M


def headings_rad(snapshot: StatusSnapshot):
    return snapshot.actual_pos[list(STEER_AXES)]


@pytest.fixture
def rig(start: Callable[..., NodeProcess], peer: Peer, tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(start, peer, tmp_path)
    yield rig
    if rig.node is not None:
        rig.node.stop()  # before the engine, because the node's shutdown is under test


# --- end ----------------------------------------------------------------------------------------------------


def watch_engine(rig: Rig) -> Callable[[], bool]:
    """Opens a device so that the engine outlives the node. Returns a function: is any wheel command nonzero?

    The age limit only detects an engine that has ended; the status of a stalled engine is read again.
    """
    from robot_stack.wmx import connect

    rig.device = connect("test")
    view = StatusView(runtime_dir(), DEADLINE_S)

    def moving() -> bool:
        code, snapshot = view.read()
        assert not code
        return bool(snapshot.velocity_cmd.any())

    return moving


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_way_of_the_wheels_without_their_interface(rig: Rig, number: signal.Signals) -> None:
    """The engine brakes from 1.0 m/s by itself, after the last command's remaining time.

    The engine holds the headings.
    """
    rig.ready()
    rig.command(1.0)
    rig.wait_speed(1.0)
    moving = watch_engine(rig)
    rig.node.signal(number)
    # Measured after the signal, because until then the interface commands.
    begun = rig.status()
    wait_for(lambda: not moving(), "standstill")
    rig.wait_speed(0.0)
    distance_m = (wheels_m(rig.status()) - wheels_m(begun)).max()
    held = abs(headings_rad(rig.status()) - headings_rad(begun)).max()
    took_s = rig.status().engine_time_s - begun.engine_time_s
    print(f"interface {number.name}: {distance_m:.3f} m, watched for {took_s:.2f} s of the engine's time")
    try:
        assert distance_m < 0.5 * 1.0**2 / ROBOT.emergency_deceleration_mps2 + 0.25 * 1.0
        assert held < 1e-3
        assert rig.status().servo_on.all()
    finally:
        rig.node.signal(signal.SIGCONT if number is signal.SIGSTOP else signal.SIGKILL)


def test_second_interface_refuses_to_start(rig: Rig) -> None:
    rig.start_node()
    second = rig.start("swerve_hardware_interface")
    assert second.wait() == 2
    assert "swerve_hardware_interface is already running" in second.output()


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("steering_periods:=0.5", "steering_periods: Input should be greater than or equal to 1"),
        ("command_lifetime_s:=0.15", "command_lifetime_s must be above 0.15"),
    ],
)
def test_wrong_parameters_end_the_start(start: Callable[..., NodeProcess], argument: str, says: str) -> None:
    process = start("swerve_hardware_interface", "-p", argument)
    assert process.wait() == 2
    assert says in process.output()
