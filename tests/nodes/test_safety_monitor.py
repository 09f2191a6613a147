"""The safety monitor's process among real peers: a simulated engine, a fake robot, hearts that are really killed."""

from __future__ import annotations

import math
import os
import signal
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import BatteryState, Imu, JointState, PointCloud2
from std_msgs.msg import Bool, Float32

from custom_msgs.srv import ClearEmergencyStop
from robot_stack.contract import services, topics
from robot_stack.contract.frames import JOINTS
from robot_stack.core.point_cloud import SWEEP, Points, moving_points, points_from_xyz
from robot_stack.core.runtime import state_dir, state_shadow_dir
from robot_stack.core.stop_presence import Presence, parse_presence
from robot_stack.middleware.point_cloud import cloud_message
from robot_stack.safety.latch_store import COPIES, decode
from robot_stack.safety.monitor import Memory
from robot_stack.safety.nodes.safety_monitor import LATCH_FILE, LATCH_FOLDER
from robot_stack.safety.stop_sources import Press
from tests.support.engine import BUTTON_PRESSED, BUTTON_RELEASED, TestEngine
from tests.support.held_up import HeldUp
from tests.support.processes import ROOT, NodeProcess
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Heard, Peer

Start = Callable[..., NodeProcess]
# Faults that this file does not play with would only slow its tests down.
ROWS = ("ESTOP_PRESSED", "DRIVE_FAULT", "TILT", "NODE_DEAD", "SLOPE", "LATCH_NOT_STORED")
# A test that is held up for 0.1 s is a silent sensor: only what is about that asks for it.
SILENT_SENSORS = ("JOINT_STATES_TIMEOUT", "IMU_TIMEOUT")
HEART = ROOT / "tests" / "nodes" / "scripts" / "heartbeat_sender.py"


@pytest.fixture
def engine(start: Start, tmp_path: Path) -> Iterator[TestEngine]:
    engine = TestEngine(start, tmp_path)
    yield engine
    engine.close()


def rows(names: Sequence[str]) -> str:
    """The parameter that asks for these faults only."""
    return f"rows:=[{', '.join(names)}]"


def latched(message: Any) -> bool:
    return bool(message.safety_state == "EMERGENCY_STOP")


def presence(message: DiagnosticArray) -> dict[str, Presence]:
    """Of the sources that press, as the safety monitor tells it."""
    statuses = [status for status in message.status if status.name == "safety_monitor"]
    return parse_presence({item.key: item.value for status in statuses for item in status.values})


class FakeRobot:
    """Joint states, IMU, pose, quality and battery of a robot that stands level, at the contract's rates."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._samples = 0
        self.wheel_radps = 0.0
        self.publish_all()

    def publish_all(self) -> None:
        peer = self._peer
        peer.repeat(topics.JOINT_STATES, self._joint_states, 50.0)
        peer.repeat(topics.IMU, self._imu, 100.0)
        peer.repeat(topics.CURRENT_POSE, PoseStamped, 10.0)
        peer.repeat(topics.LOCALIZATION_QUALITY, lambda: Float32(data=0.9), 10.0)
        peer.repeat(topics.BATTERY_STATE, lambda: BatteryState(percentage=0.8), 2.0)

    def _joint_states(self) -> JointState:
        return JointState(name=list(JOINTS), position=[0.0] * 8, velocity=[self.wheel_radps, 0.0] * 4)

    def _imu(self) -> Imu:
        self._samples += 1
        message = Imu()
        message.linear_acceleration.z = 9.81 + 1e-6 * self._samples
        return message


class Scene:
    """A monitor, everything it needs, and what it says."""

    def __init__(self, start: Start, peer: Peer, engine: TestEngine, *arguments: str) -> None:
        self._start = start
        self.peer = peer
        self.engine = engine
        self.status: Heard = peer.listen(topics.SAFETY_STATUS)
        self.limit: Heard = peer.listen(topics.VELOCITY_LIMIT)
        self.robot = FakeRobot(peer)
        self.heart = self.start_heart()
        self.monitor = self.start_monitor(*arguments)

    def start_heart(self) -> NodeProcess:
        return self._start("heart", command=[sys.executable, str(HEART), "swerve_controller"])

    def start_monitor(self, *arguments: str) -> NodeProcess:
        return self._start(
            "safety_monitor", "-p", rows(ROWS), "-p", "expected_processes:=[swerve_controller]", *arguments
        )

    def wait_state(self, state: str, *faults: str, deadline_s: float = 60.0) -> Any:
        """The status once it shows ``state`` and at least these faults: a machine that is held up may add others."""

        def matches(message: Any) -> bool:
            return message.safety_state == state and set(faults) <= set(message.active_faults)

        wait_for(lambda: self.status.items, "any /safety/status", deadline_s)
        try:
            return self.status.wait(matches, f"{state} {faults}", deadline_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; last {self.status.last}\n{self.monitor.output()}") from None

    def normal(self) -> Scene:
        """Waits for NORMAL. What a machine that was held up has latched is reset, as an operator would."""

        def is_normal() -> bool:
            latched = bool(self.status.items) and self.status.last.safety_state == "EMERGENCY_STOP"
            if latched and "ESTOP_PRESSED" not in self.status.last.active_faults:
                self.reset()
            return bool(self.status.items) and self.status.last.safety_state == "NORMAL"

        wait_for(is_normal, "NORMAL", 60.0, poll_s=0.1)
        self.limit.wait(lambda message: message.reason == "", "the robot's own limit")
        return self

    def estop(self, pressed: bool) -> None:
        self.peer.stop_source().publish(pressed)

    def reset(self) -> Any:
        return self.peer.call(services.SAFETY_RESET)

    def clear(self, source: str) -> Any:
        return self.peer.call(services.CLEAR_EMERGENCY_STOP, ClearEmergencyStop.Request(source=source))

    def reset_until_granted(self) -> None:
        answers: list[Any] = []

        def granted() -> bool:
            answers.append(self.reset())
            return bool(answers[-1].success)

        try:
            wait_for(granted, "a granted reset")
        except AssertionError as error:
            raise AssertionError(f"{error}; last answer: {answers[-1].message}") from None


@pytest.fixture
def scene(start: Start, peer: Peer, engine: TestEngine) -> Scene:
    engine.run().up()
    return Scene(start, peer, engine)


def test_normal_start_rates_and_no_obstacle_known(scene: Scene) -> None:
    scene.wait_state("NORMAL")
    assert all(message.safety_state != "EMERGENCY_STOP" for message in scene.status.messages)
    limit = scene.limit.wait(lambda message: message.reason == "", "the robot's own limit")
    assert (limit.max_linear_velocity, limit.max_angular_velocity) == (1.5, 1.0)
    status = scene.status.last
    assert status.header.frame_id == "base_link"
    assert list(status.active_faults) == []
    assert status.min_obstacle_distance != status.min_obstacle_distance  # NaN: unknown
    assert not status.emergency_stop_active
    scene.status.wait_period(0.1)


def test_a_stop_shows_within_50_ms_and_limits_to_zero(scene: Scene) -> None:
    """Five presses; the median, because a test machine that is busy with other things delays single ones."""
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    to_status_s, to_limit_s = [], []
    for _ in range(5):
        sent_s = time.monotonic()
        scene.estop(True)
        scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
        limit = scene.limit.wait(lambda message: message.max_linear_velocity == 0.0, "a standstill")
        assert (limit.max_angular_velocity, limit.reason) == (0.0, "ESTOP_PRESSED")
        to_status_s.append(_first(scene.status, sent_s, latched) - sent_s)
        to_limit_s.append(_first(scene.limit, sent_s, lambda m: m.max_linear_velocity == 0.0) - sent_s)
        scene.estop(False)
        scene.reset_until_granted()
        scene.normal()
    print("/emergency_stop to status", [f"{1e3 * s:.1f} ms" for s in to_status_s])
    assert statistics.median(to_status_s) < 0.05
    assert statistics.median(to_limit_s) < 0.05


def _first(heard: Heard, since_s: float, condition: Callable[[Any], bool]) -> float:
    """When the first message since then that meets the condition arrived, steady seconds."""
    return next(at_s for at_s, message in list(heard.items) if at_s >= since_s and condition(message))


def test_the_hardware_stop_is_told_apart_from_a_latched_one(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.estop(True)
    assert not scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED").emergency_stop_active
    scene.engine.set(input0=BUTTON_PRESSED)
    scene.status.wait(lambda message: message.emergency_stop_active and latched(message), "the pressed button")
    scene.engine.set(input0=BUTTON_RELEASED)
    scene.status.wait(lambda message: not message.emergency_stop_active, "the released button")
    assert latched(scene.status.last)
    scene.engine.set(connected=False)
    scene.status.wait(lambda message: message.emergency_stop_active, "a contact that cannot be read any more")


def test_two_keys(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.estop(True)
    scene.wait_state("EMERGENCY_STOP")
    pressed = scene.reset()
    assert not pressed.success
    assert "pressed by peer" in pressed.message
    scene.robot.wheel_radps = 3.0
    scene.estop(False)
    wait_for(lambda: "less than" not in scene.reset().message, "the settling time")
    moving = scene.reset()
    assert not moving.success
    assert "does not stand still" in moving.message
    scene.robot.wheel_radps = 0.0
    assert latched(scene.status.last)
    scene.reset_until_granted()
    # A machine that is held up just then latches a stop of its own.
    wait_for(lambda: scene.normal().reset().message == "no emergency stop is latched", "nothing left to be reset")


def test_a_killed_process_is_missed_and_welcomed_back(scene: Scene) -> None:
    scene.normal()
    with HeldUp() as machine:
        killed_s = time.monotonic()
        os.kill(scene.heart.pid, signal.SIGKILL)
        scene.wait_state("DEGRADED", "NODE_DEAD")
    stopped_s = _first(scene.status, killed_s, lambda message: message.active_faults)
    # the last heartbeat is at most 0.1 s older than the kill; the row's second starts there
    assert 0.85 - machine.seconds < stopped_s - killed_s < 1.3 + machine.seconds
    assert scene.limit.wait(lambda message: message.reason == "NODE_DEAD", "a stop").max_linear_velocity == 0.0
    scene.heart = scene.start_heart()
    scene.normal()


@pytest.mark.parametrize("how", ["alarm", "bus lost", "engine killed", "servo off"])
def test_drive_faults(scene: Scene, how: str, start: Start) -> None:
    scene.normal()
    with HeldUp() as machine:
        broken_s = time.monotonic()
        if how == "alarm":
            scene.engine.set(alarms={"3": 17})
        elif how == "bus lost":
            scene.engine.set(connected=False)
        elif how == "engine killed":
            scene.engine.kill()
        else:
            scene.engine.device.core_motion.axisControl.SetServoOn(3, 0)
        scene.wait_state("EMERGENCY_STOP", "DRIVE_FAULT")
    latched_s = _first(scene.status, broken_s, latched)
    print(f"{how}: {1e3 * (latched_s - broken_s):.0f} ms")
    assert latched_s - broken_s - machine.seconds < 0.5
    if how == "servo off":
        return
    assert not scene.reset().success
    if how == "engine killed":
        scene.engine.close()
        scene.engine.run().up()
    else:
        scene.engine.recover()
    scene.reset_until_granted()
    scene.normal()


def test_silent_joint_states_latch_and_a_silent_imu_limits(start: Start, peer: Peer, engine: TestEngine) -> None:
    scene = Scene(start, peer, engine.run().up(), "-p", rows((*ROWS, *SILENT_SENSORS))).normal()
    scene.peer.silence(topics.IMU)

    def limited() -> bool:
        status = scene.status.last
        if latched(status):  # by a machine that was held up
            scene.reset()
        return bool(status.safety_state == "DEGRADED" and "IMU_TIMEOUT" in status.active_faults)

    wait_for(limited, "a limit for the silent IMU", 60.0, poll_s=0.1)
    assert scene.limit.wait(lambda message: message.reason == "IMU_TIMEOUT", "slowly").max_linear_velocity == 0.5
    scene.peer.silence(topics.JOINT_STATES)
    scene.wait_state("EMERGENCY_STOP", "JOINT_STATES_TIMEOUT", "IMU_TIMEOUT")
    scene.robot.publish_all()
    scene.reset_until_granted()
    scene.normal()


def test_a_passenger_is_slower(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.PASSENGER_ATTACHED)
    scene.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    limit = scene.limit.wait(lambda message: message.reason == "PASSENGER_ONBOARD", "the passenger's limit")
    assert limit.max_linear_velocity == 1.0
    assert scene.status.last.safety_state == "NORMAL"


def test_a_latched_stop_survives_sigkill(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.estop(True)
    scene.wait_state("EMERGENCY_STOP")
    os.kill(scene.monitor.pid, signal.SIGKILL)
    scene.monitor.wait()
    scene.estop(False)
    count = len(scene.status.items)
    scene.monitor = scene.start_monitor()
    wait_for(lambda: len(scene.status.items) > count, "the new monitor")
    assert all(latched(message) for message in scene.status.messages[count:])
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.estop(False)
    scene.reset_until_granted()
    scene.normal()


def latch_copies() -> list[Path]:
    return [state_dir() / LATCH_FOLDER / name for name in COPIES]


def test_a_latched_stop_survives_the_loss_of_the_runtime_folder(scene: Scene) -> None:
    """What a logout or a reboot takes away."""
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.peer.wait_matched(topics.EMERGENCY_STOP_SOURCES)
    scene.estop(True)
    scene.wait_state("EMERGENCY_STOP")
    wanted = Memory(("ESTOP_PRESSED",), False, (Press("peer", os.getpid()),))
    wait_for(lambda: [decode(path.read_bytes()).memory for path in latch_copies()] == [wanted] * 2, "both copies")
    os.kill(scene.monitor.pid, signal.SIGKILL)
    scene.monitor.wait()
    (state_shadow_dir() / LATCH_FILE).unlink()
    count = len(scene.status.items)
    scene.monitor = scene.start_monitor()
    wait_for(lambda: len(scene.status.items) > count, "the new monitor")
    assert all(latched(message) for message in scene.status.messages[count:])
    # What is released before the new monitor knows who has pressed is a press of somebody unknown.
    wait_for(lambda: knows("peer", scene.reset().message), "the new monitor knows who has pressed")
    scene.estop(False)
    scene.reset_until_granted()
    scene.normal()


def knows(source: str, refusal: str) -> bool:
    """A refused reset names a source that is there."""
    return f"pressed by {source}" in refusal and "(gone)" not in refusal


def test_a_latch_that_cannot_be_written_slows_the_robot(scene: Scene) -> None:
    scene.normal()
    folder = state_dir() / LATCH_FOLDER
    folder.rename(folder.with_name("away"))
    folder.write_text("in the way")
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.estop(True)
    scene.wait_state("EMERGENCY_STOP", "LATCH_NOT_STORED")
    folder.unlink()
    scene.status.wait(lambda message: "LATCH_NOT_STORED" not in message.active_faults, "written")


def test_a_true_of_nobody_known_is_cleared_by_name(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.estop(False)  # another source's
    wait_for(lambda: "pressed by unknown" in scene.reset().message, "a refusal that names it")
    refused = scene.clear("peer")
    assert (refused.success, refused.message) == (False, "refused: 'peer' is not pressed; pressed: unknown")
    assert scene.clear("unknown").success
    scene.reset_until_granted()
    scene.normal()


def test_a_false_of_another_source_and_a_silent_author_release_nothing(scene: Scene) -> None:
    scene.normal()
    scene.peer.wait_matched(topics.EMERGENCY_STOP)
    scene.peer.wait_matched(topics.EMERGENCY_STOP_SOURCES)
    scene.peer.stop_source("panel").publish(True)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.estop(False)
    wait_for(lambda: "less than" not in scene.reset().message, "the settling time")
    assert scene.reset().message == "refused: ESTOP_PRESSED: pressed by panel"
    assert "release it there" in scene.clear("panel").message
    told = scene.peer.listen(topics.DIAGNOSTICS)
    scene.peer.end_source("panel")
    told.wait(lambda message: presence(message) == {"panel": Presence.GONE}, "the panel to be told as gone")
    wait_for(lambda: "pressed by panel (gone)" in scene.reset().message, "the panel to be missed")
    assert scene.clear("panel").success
    scene.reset_until_granted()
    scene.normal()


def test_limit_and_status_are_repeated_ten_times_a_second(scene: Scene) -> None:
    scene.normal()
    scene.limit.wait_period(0.1)


def test_a_corrupt_latch_file_is_an_emergency(scene: Scene) -> None:
    scene.normal()
    os.kill(scene.monitor.pid, signal.SIGKILL)
    scene.monitor.wait()
    for path in (*latch_copies(), state_shadow_dir() / LATCH_FILE):
        path.write_text("{half")
    count = len(scene.status.items)
    scene.monitor = scene.start_monitor()
    wait_for(lambda: len(scene.status.items) > count, "the new monitor")
    assert all(latched(message) for message in scene.status.messages[count:])
    wait_for(
        lambda: "PASSENGER" not in scene.limit.last.reason and scene.limit.last.max_linear_velocity == 0.0, "a stop"
    )


def test_a_normal_end_leaves_no_latch_and_stops_the_drive(scene: Scene) -> None:
    scene.normal()
    scene.monitor.signal(signal.SIGTERM)
    assert scene.monitor.wait() == 0
    limit = scene.limit.wait(lambda message: message.max_linear_velocity == 0.0, "the last word")
    assert limit.reason == "NODE_DEAD"
    assert [decode(path.read_bytes()).memory for path in latch_copies()] == [Memory(), Memory()]


def test_a_drive_that_never_comes_up_is_never_normal(start: Start, peer: Peer, engine: TestEngine) -> None:
    scene = Scene(start, peer, engine, "-p", "startup_grace_s:=4.0")
    scene.wait_state("DEGRADED", "DRIVE_FAULT")
    assert scene.limit.wait(lambda _: True, "a limit").max_linear_velocity == 0.0
    scene.wait_state("EMERGENCY_STOP", "DRIVE_FAULT")
    assert all(message.safety_state != "NORMAL" for message in scene.status.messages)


class FakeSurroundings:
    """Sweeps and obstacles at the contract's rates. obstacles: (n, 3) m, base_link."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._noise = np.random.default_rng(1)
        self.frozen = False
        self.obstacles = self.unseen = np.empty((0, 3), np.float32)
        self.moving = np.empty((0, 5), np.float32)
        self._sweep = self._new_sweep()
        peer.repeat(topics.LIDAR_POINTS, self._points, 10.0)
        peer.repeat(topics.OVERHEAD_LIDAR_POINTS, self.overhead, 10.0)
        peer.repeat(topics.OBSTACLES, self._cloud, 20.0)
        peer.repeat(topics.UNSEEN_SPACE, self._ends, 20.0)
        peer.repeat(topics.MOVING, self.bodies, 20.0)
        peer.repeat(topics.CMD_VEL_LIMITED, TwistStamped, 20.0)

    def _new_sweep(self) -> PointCloud2:
        bearing = np.linspace(-math.pi, math.pi, 6000)
        sweep = np.zeros(len(bearing), SWEEP)
        sweep["x"], sweep["y"] = 8.0 * np.cos(bearing), 8.0 * np.sin(bearing)
        sweep["z"] = self._noise.normal(0.0, 0.02, len(bearing))
        return cloud_message(sweep, "lidar")

    def _points(self) -> PointCloud2:
        if not self.frozen:
            self._sweep = self._new_sweep()
        self._sweep.header.stamp = self._peer.node.get_clock().now().to_msg()
        return self._sweep

    def overhead(self) -> PointCloud2:
        message = self._new_sweep()
        message.header.frame_id = "overhead_lidar"
        return message

    def _cloud(self) -> PointCloud2:
        return self._message(self.obstacles)

    def _ends(self) -> PointCloud2:
        return self._message(self.unseen)

    def bodies(self) -> PointCloud2:
        return self._stamped(moving_points(self.moving))

    def _message(self, points: NDArray[np.float32]) -> PointCloud2:
        return self._stamped(points_from_xyz(points))

    def _stamped(self, points: Points) -> PointCloud2:
        message = cloud_message(points, "base_link")
        message.header.stamp = self._peer.node.get_clock().now().to_msg()
        return message


def test_obstacles_slow_and_stop_and_blindness_stops(start: Start, peer: Peer, engine: TestEngine) -> None:
    around = FakeSurroundings(peer)
    asked = ("ESTOP_PRESSED", "COLLISION_IMMINENT", "OBSTACLE_NEAR", "LIDAR_TIMEOUT", "OBSTACLES_TIMEOUT")
    scene = Scene(start, peer, engine.run().up(), "-p", rows(asked))
    scene.wait_state("NORMAL")
    scene.status.wait(lambda message: message.min_obstacle_distance == math.inf, "nothing near")
    around.obstacles = np.array([[1.01, y, 0.8] for y in np.arange(-0.5, 0.5, 0.05)], np.float32)
    wall = scene.status.wait(lambda message: 0.49 < message.min_obstacle_distance < 0.52, "the wall")
    assert wall.safety_state == "NORMAL"  # nobody wants to go there

    def requested() -> Twist:
        message = Twist()
        message.linear.x = 0.4
        return message

    scene.peer.repeat(topics.CMD_VEL, requested, 20.0)
    scene.wait_state("COLLISION_AVOIDANCE", "OBSTACLE_NEAR")
    near = scene.limit.wait(lambda message: message.reason == "OBSTACLE_NEAR", "a limit")
    assert near.max_linear_velocity == pytest.approx(0.2)
    around.obstacles = around.obstacles - np.array([0.41, 0.0, 0.0], np.float32)
    scene.wait_state("COLLISION_AVOIDANCE", "COLLISION_IMMINENT")
    stop = scene.limit.wait(lambda message: message.reason == "COLLISION_IMMINENT", "a stop")
    assert (stop.max_linear_velocity, stop.max_angular_velocity) == (0.0, 0.0)
    around.obstacles = np.empty((0, 3), np.float32)
    scene.wait_state("NORMAL")
    around.unseen = np.array([[0.6, y, 0.0] for y in np.arange(-0.5, 0.5, 0.05)], np.float32)
    slow = scene.limit.wait(lambda message: message.reason == "WAY_UNSEEN", "a limit where nothing is seen")
    assert slow.max_linear_velocity == pytest.approx(0.3)
    around.unseen = np.empty((0, 3), np.float32)
    scene.limit.wait(lambda message: message.reason == "", "no limit")
    around.moving = np.array([[0.6, 1.0, 0.8, 0.0, -1.0]], np.float32)  # from the side into the way
    scene.wait_state("COLLISION_AVOIDANCE", "COLLISION_IMMINENT")
    around.moving = np.empty((0, 5), np.float32)
    scene.wait_state("NORMAL")
    scene.peer.silence(topics.MOVING)
    scene.limit.wait(lambda message: message.reason == "WAY_UNSEEN", "a limit where nobody says who comes")
    scene.peer.repeat(topics.MOVING, around.bodies, 20.0)
    scene.limit.wait(lambda message: message.reason == "", "no limit")
    scene.peer.silence(topics.UNSEEN_SPACE)
    scene.limit.wait(lambda message: message.reason == "WAY_UNSEEN", "a limit where nobody says what is seen")
    around.frozen = True
    scene.wait_state("DEGRADED", "LIDAR_TIMEOUT")
    assert "frozen" in scene.monitor.output()
    around.frozen = False
    scene.wait_state("NORMAL")
    scene.peer.silence(topics.OVERHEAD_LIDAR_POINTS)
    scene.wait_state("DEGRADED", "LIDAR_TIMEOUT")
    assert "/sensors/overhead_lidar/points" in scene.monitor.output()
    scene.peer.repeat(topics.OVERHEAD_LIDAR_POINTS, around.overhead, 10.0)
    scene.wait_state("NORMAL")
    scene.peer.silence(topics.OBSTACLES)
    scene.wait_state("DEGRADED", "OBSTACLES_TIMEOUT")
    scene.status.wait(lambda message: math.isnan(message.min_obstacle_distance), "nobody knows")


@pytest.mark.parametrize(
    ("argument", "complaint"),
    [
        ("tilt_stop_deg:=1e9", "tilt_stop_deg"),
        ("rows:=[TILT]", "ESTOP_PRESSED must be among the rows"),
        ("rows:=[ESTOP_PRESSED, NO_SUCH]", "NO_SUCH is not a fault of the contract"),
        ("expected_processes:=[nobody]", "nobody is not a process"),
        ("no_such:=1", "no_such"),
    ],
)
def test_bad_parameters_stop_the_start(start: Start, argument: str, complaint: str) -> None:
    process = start("safety_monitor", "-p", argument)
    assert process.wait() == 2
    assert complaint in process.output()
    assert process.output().count("\n") == 1


def test_a_list_without_items_is_one(start: Start, peer: Peer, engine: TestEngine) -> None:
    """ROS hands an empty list over as no value at all; `robot-stack up --only safety_monitor` sends one."""
    heard = peer.listen(topics.SAFETY_STATUS)
    monitor = start("safety_monitor", "-p", "rows:=[ESTOP_PRESSED]", "-p", "expected_processes:=[]")
    wait_for(lambda: heard.items or not monitor.running(), "any /safety/status")
    assert monitor.running(), monitor.output()
