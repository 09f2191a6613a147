"""The safety monitor with a motion engine on virtual drives, a standing robot, and a process with a heartbeat."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from numpy.typing import NDArray
from sensor_msgs.msg import BatteryState, Imu, JointState, PointCloud2
from std_msgs.msg import Float32

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
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench
from tests.simulated.story import Received

ROWS = (
    "ESTOP_PRESSED",
    "DRIVE_FAULT",
    "JOINT_STATES_TIMEOUT",
    "IMU_TIMEOUT",
    "TILT",
    "NODE_DEAD",
    "SLOPE",
    "LATCH_NOT_STORED",
)
HEART = "swerve_controller"
TICK_S = 0.02
# From a tick's detection to the message at a peer: the tick may wait for a running wake-up.
SHOWN_S = 2.0 * COMPUTE_S + LATENCY_S


def latched(message: Any) -> bool:
    return bool(message.safety_state == "EMERGENCY_STOP")


def presence(message: DiagnosticArray) -> dict[str, Presence]:
    """The presence of the pressed sources, as the safety monitor reports it."""
    statuses = [status for status in message.status if status.name == "safety_monitor"]
    return parse_presence({item.key: item.value for status in statuses for item in status.values})


def first_s(received: Received, since_s: float, condition: Callable[[Any], Any]) -> float:
    """Time from ``since_s`` to the first message that meets the condition."""
    return next(at_s for at_s, message in received.items if at_s >= since_s and condition(message)) - since_s


def latch_copies() -> list[Path]:
    return [state_dir() / LATCH_FOLDER / name for name in COPIES]


class Scene:
    """A monitor, its inputs and its published messages."""

    def __init__(self, bench: Bench, rows: Sequence[str] = ROWS, **parameters: Any) -> None:
        self.bench = bench
        self.status, self.limit = bench.listen(topics.SAFETY_STATUS), bench.listen(topics.VELOCITY_LIMIT)
        self.wheel_radps = 0.0
        self._samples = 0
        self.sense()
        self.source = bench.source()
        self.heart = bench.heart(HEART)
        given = {"rows": list(rows), "expected_processes": [HEART], **parameters}
        self.monitor = bench.start("safety_monitor", given)

    def sense(self) -> None:
        """Publishes the sensors of a level, standing robot at the contract's rates."""
        bench = self.bench
        bench.repeat(topics.JOINT_STATES, self._joint_states, 50.0)
        bench.repeat(topics.IMU, self._imu, 100.0)
        bench.repeat(topics.CURRENT_POSE, PoseStamped, 10.0)
        bench.repeat(topics.LOCALIZATION_QUALITY, lambda: Float32(data=0.9), 10.0)
        bench.repeat(topics.BATTERY_STATE, lambda: BatteryState(percentage=0.8), 2.0)

    def _joint_states(self) -> JointState:
        return JointState(name=list(JOINTS), position=[0.0] * 8, velocity=[self.wheel_radps, 0.0] * 4)

    def _imu(self) -> Imu:
        self._samples += 1
        message = Imu()
        message.linear_acceleration.z = 9.81 + 1e-6 * self._samples
        return message

    def wait_state(self, state: str, *faults: str, limit_s: float = 10.0) -> Any:
        return self.status.wait(
            lambda message: message.safety_state == state and list(message.active_faults) == list(faults),
            f"{state} {faults}",
            limit_s,
        )

    def wait_reason(self, reason: str) -> Any:
        return self.limit.wait(lambda message: message.reason == reason, f"a limit for {reason!r}")

    def normal(self) -> Scene:
        self.wait_state("NORMAL")
        self.wait_reason("")
        return self

    def reset(self) -> Any:
        return self.bench.call(services.SAFETY_RESET)

    def clear(self, source: str) -> Any:
        return self.bench.call(services.CLEAR_EMERGENCY_STOP, ClearEmergencyStop.Request(source=source))

    def release(self) -> None:
        """Both release steps, after the settling time."""
        self.source.publish(False)
        self.bench.run(0.4)
        answer = self.reset()
        assert answer.success, answer.message
        self.normal()

    def kill_and_start(self, between: Callable[[], None] = lambda: None) -> list[Any]:
        """SIGKILL and a restart. Returns the messages of the new process so far."""
        self.monitor.kill()
        between()
        begun_s = self.bench.now_s
        self.bench.start_again(self.monitor)
        self.bench.run(0.5)
        messages = self.status.since(begun_s)
        assert messages
        return messages


@pytest.fixture
def scene(bench: Bench) -> Scene:
    bench.engine.run().up()
    return Scene(bench)


def test_normal_start_rates_and_no_obstacle_known(scene: Scene) -> None:
    scene.normal()
    assert not any(latched(message) for message in scene.status.messages)
    limit = scene.limit.last
    assert (limit.max_linear_velocity, limit.max_angular_velocity) == (1.5, 1.0)
    status = scene.status.last
    assert status.header.frame_id == "base_link"
    assert math.isnan(status.min_obstacle_distance)
    assert not status.emergency_stop_active
    scene.bench.run(3.0)
    assert scene.status.period_s() == pytest.approx(0.1, abs=1e-6)
    assert scene.limit.period_s() == pytest.approx(0.05, abs=1e-6)


def test_a_stop_shows_at_once_and_limits_to_zero(scene: Scene) -> None:
    """The stop does not wait for the next tick of 20 ms or the next repetition."""
    scene.normal()
    for phase in range(5):
        scene.bench.run(0.1 + 0.004 * phase)
        sent_s = scene.bench.now_s
        scene.source.publish(True)
        scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
        assert first_s(scene.status, sent_s, latched) <= LATENCY_S + SHOWN_S
        assert first_s(scene.limit, sent_s, lambda m: m.max_linear_velocity == 0.0) <= LATENCY_S + SHOWN_S
        limit = scene.limit.last
        assert (limit.max_angular_velocity, limit.reason) == (0.0, "ESTOP_PRESSED")
        scene.release()


def test_hardware_stop_is_distinguished_from_a_latched_one(scene: Scene) -> None:
    scene.normal()
    scene.source.publish(True)
    assert not scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED").emergency_stop_active
    engine = scene.bench.engine
    engine.press(True)
    scene.status.wait(lambda message: message.emergency_stop_active and latched(message), "the pressed button", 0.2)
    engine.press(False)
    scene.status.wait(lambda message: not message.emergency_stop_active, "the released button", 0.2)
    assert latched(scene.status.last)
    engine.drives.connected = False
    scene.status.wait(lambda message: message.emergency_stop_active, "a contact that cannot be read any more", 0.5)


def test_two_keys(scene: Scene) -> None:
    scene.normal()
    scene.source.publish(True)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    pressed = scene.reset()
    assert not pressed.success
    assert "pressed by peer" in pressed.message
    scene.wheel_radps = 3.0
    scene.source.publish(False)
    assert "less than" in scene.reset().message  # within the settling time
    scene.bench.run(0.4)
    moving = scene.reset()
    assert not moving.success
    assert "is not at standstill" in moving.message
    scene.wheel_radps = 0.0
    assert latched(scene.status.last)
    scene.bench.run(0.4)
    assert scene.reset().success
    scene.normal()
    assert scene.reset().message == "no emergency stop is latched"


def test_a_killed_process_is_missed_and_welcomed_back(scene: Scene) -> None:
    scene.normal()
    killed_s = scene.bench.now_s
    scene.heart.process.kill()
    scene.wait_state("DEGRADED", "NODE_DEAD")
    # The newest beat is at most 0.1 s older than the end of the process; a tick detects the missing one.
    took_s = first_s(scene.status, killed_s, lambda message: message.active_faults)
    assert 0.9 <= took_s <= 1.0 + 2.0 * TICK_S + SHOWN_S
    assert scene.wait_reason("NODE_DEAD").max_linear_velocity == 0.0
    scene.bench.start_again(scene.heart.process)
    scene.normal()


@pytest.mark.parametrize(
    ("how", "least_s", "limit_s"),
    [
        ("alarm", 0.0, 0.0),
        ("bus lost", 0.0, 0.15),
        ("engine killed", 0.1, 0.1),
        ("servo off", 0.1, 0.1),
    ],
)
def test_drive_faults(scene: Scene, how: str, least_s: float, limit_s: float) -> None:
    """limit_s: required duration of the fault, without the engine's block, a status read and a tick."""
    scene.normal()
    engine, broken_s = scene.bench.engine, scene.bench.now_s
    if how == "alarm":
        engine.alarm(3, 17)
    elif how == "bus lost":
        engine.drives.connected = False
    elif how == "engine killed":
        engine.kill()
    else:
        engine.device.core_motion.axisControl.SetServoOn(3, 0)
    scene.wait_state("EMERGENCY_STOP", "DRIVE_FAULT")
    assert least_s <= first_s(scene.status, broken_s, latched) <= limit_s + 0.005 + 0.01 + TICK_S + SHOWN_S
    if how == "servo off":
        return
    assert not scene.reset().success
    if how == "engine killed":
        engine.run().up()
    else:
        engine.recover()
    scene.bench.run(1.0)
    assert scene.reset().success
    scene.normal()


def test_silent_joint_states_latch_and_a_silent_imu_limits(scene: Scene) -> None:
    scene.normal()
    bench, silent_s = scene.bench, scene.bench.now_s
    bench.silence(topics.IMU)
    scene.wait_state("DEGRADED", "IMU_TIMEOUT")
    assert 0.09 <= first_s(scene.status, silent_s, lambda m: m.active_faults) <= 0.1 + TICK_S + LATENCY_S + SHOWN_S
    assert scene.wait_reason("IMU_TIMEOUT").max_linear_velocity == 0.5
    silent_s = bench.now_s
    bench.silence(topics.JOINT_STATES)
    scene.wait_state("EMERGENCY_STOP", "JOINT_STATES_TIMEOUT", "IMU_TIMEOUT")
    assert 0.08 <= first_s(scene.status, silent_s, latched) <= 0.1 + TICK_S + LATENCY_S + SHOWN_S
    scene.sense()
    bench.run(1.5)
    assert scene.reset().success
    scene.normal()


def test_a_latched_stop_survives_sigkill(scene: Scene) -> None:
    scene.normal()
    scene.source.publish(True)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    messages = scene.kill_and_start(lambda: scene.source.publish(False))
    assert all(latched(message) for message in messages)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.release()


def test_a_latched_stop_survives_the_loss_of_the_runtime_folder(scene: Scene) -> None:
    """A logout or a reboot removes the runtime folder."""
    scene.normal()
    scene.source.publish(True)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.bench.run(0.5)
    first, second = (decode(path.read_bytes()).memory for path in latch_copies())
    (press,) = first.presses
    assert first == second == Memory(("ESTOP_PRESSED",), False, (press,))
    assert (press.name, press.pid) == ("peer", scene.bench.port.process_id)
    messages = scene.kill_and_start(lambda: (state_shadow_dir() / LATCH_FILE).unlink())
    assert all(latched(message) for message in messages)
    refusal = scene.reset().message
    assert "pressed by peer" in refusal
    assert "(gone)" not in refusal
    scene.release()


def test_false_of_another_source_and_a_silent_source_do_not_release(scene: Scene) -> None:
    scene.normal()
    panel = scene.bench.source("panel")
    panel.publish(True)
    scene.wait_state("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.source.publish(False)
    scene.bench.run(0.4)
    assert scene.reset().message == "refused: ESTOP_PRESSED: pressed by panel"
    assert "release it there" in scene.clear("panel").message
    shown = scene.bench.listen(topics.DIAGNOSTICS)
    panel.end()
    shown.wait(lambda message: presence(message) == {"panel": Presence.GONE}, "the panel to be reported as gone")
    assert "pressed by panel (gone)" in scene.reset().message
    assert scene.clear("panel").success
    scene.release()


def test_a_corrupt_latch_file_is_an_emergency(scene: Scene) -> None:
    scene.normal()

    def corrupt() -> None:
        for path in (*latch_copies(), state_shadow_dir() / LATCH_FILE):
            path.write_text("{half")

    assert all(latched(message) for message in scene.kill_and_start(corrupt))
    limit = scene.limit.last
    assert limit.max_linear_velocity == 0.0
    assert "PASSENGER" not in limit.reason


def test_a_normal_end_leaves_no_latch_and_stops_the_drive(scene: Scene) -> None:
    scene.normal()
    assert scene.bench.stop(scene.monitor) == 0
    scene.bench.run(0.1)
    limit = scene.limit.last
    assert (limit.max_linear_velocity, limit.reason) == (0.0, "NODE_DEAD")
    assert [decode(path.read_bytes()).memory for path in latch_copies()] == [Memory(), Memory()]


class FakeSurroundings:
    """Sweeps and obstacles at the contract's rates. obstacles: (n, 3) m, base_link."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._noise = np.random.default_rng(1)
        self.frozen = False
        self.obstacles = self.unseen = np.empty((0, 3), np.float32)
        self.moving = np.empty((0, 5), np.float32)
        self._sweep = self._new_sweep()
        bench.repeat(topics.LIDAR_POINTS, self._points, 10.0)
        bench.repeat(topics.OVERHEAD_LIDAR_POINTS, self.overhead, 10.0)
        bench.repeat(topics.OBSTACLES, lambda: self._stamped(points_from_xyz(self.obstacles)), 20.0)
        bench.repeat(topics.UNSEEN_SPACE, lambda: self._stamped(points_from_xyz(self.unseen)), 20.0)
        bench.repeat(topics.MOVING, self.bodies, 20.0)
        bench.repeat(topics.CMD_VEL_LIMITED, TwistStamped, 20.0)

    def _new_sweep(self) -> PointCloud2:
        bearing = np.linspace(-math.pi, math.pi, 6000)
        sweep = np.zeros(len(bearing), SWEEP)
        sweep["x"], sweep["y"] = 8.0 * np.cos(bearing), 8.0 * np.sin(bearing)
        sweep["z"] = self._noise.normal(0.0, 0.02, len(bearing))
        return cloud_message(sweep, "lidar")

    def _points(self) -> PointCloud2:
        if not self.frozen:
            self._sweep = self._new_sweep()
        self._sweep.header.stamp = self._bench.stamp()
        return self._sweep

    def overhead(self) -> PointCloud2:
        message = self._new_sweep()
        message.header.frame_id = "overhead_lidar"
        return message

    def bodies(self) -> PointCloud2:
        return self._stamped(moving_points(self.moving))

    def _stamped(self, points: Points) -> PointCloud2:
        message = cloud_message(points, "base_link")
        message.header.stamp = self._bench.stamp()
        return message


def wall(x_m: float, z_m: float) -> NDArray[np.float32]:
    return np.array([[x_m, y, z_m] for y in np.arange(-0.5, 0.5, 0.05)], np.float32)


def test_obstacles_slow_and_stop_and_blindness_stops(bench: Bench) -> None:
    nothing = np.empty((0, 3), np.float32)
    around = FakeSurroundings(bench)
    bench.engine.run().up()
    asked = ("ESTOP_PRESSED", "COLLISION_IMMINENT", "OBSTACLE_NEAR", "LIDAR_TIMEOUT", "OBSTACLES_TIMEOUT")
    scene = Scene(bench, asked)
    scene.wait_state("NORMAL")
    scene.status.wait(lambda message: message.min_obstacle_distance == math.inf, "nothing near")
    around.obstacles = wall(1.01, 0.8)
    seen = scene.status.wait(lambda message: 0.49 < message.min_obstacle_distance < 0.52, "the wall")
    assert seen.safety_state == "NORMAL"  # no motion leads to it

    def requested() -> Twist:
        message = Twist()
        message.linear.x = 0.4
        return message

    bench.repeat(topics.CMD_VEL, requested, 20.0)
    scene.wait_state("COLLISION_AVOIDANCE", "OBSTACLE_NEAR")
    assert scene.wait_reason("OBSTACLE_NEAR").max_linear_velocity == pytest.approx(0.2)
    around.obstacles = wall(0.6, 0.8)
    near_s = bench.now_s
    scene.status.wait(lambda message: "COLLISION_IMMINENT" in message.active_faults, "a stop", 0.2)
    # The next cloud is at most 50 ms away.
    assert first_s(scene.status, near_s, lambda m: "COLLISION_IMMINENT" in m.active_faults) < 0.05 + TICK_S + 0.005
    stop = scene.wait_reason("COLLISION_IMMINENT")
    assert (stop.max_linear_velocity, stop.max_angular_velocity) == (0.0, 0.0)
    around.obstacles = nothing
    scene.wait_state("NORMAL")
    around.unseen = wall(0.6, 0.0)
    assert scene.wait_reason("WAY_UNSEEN").max_linear_velocity == pytest.approx(0.3)
    around.unseen = nothing
    scene.wait_reason("")
    around.moving = np.array([[0.6, 1.0, 0.8, 0.0, -1.0]], np.float32)  # from the side into the robot's way
    scene.status.wait(lambda message: "COLLISION_IMMINENT" in message.active_faults, "a stop")
    around.moving = np.empty((0, 5), np.float32)
    scene.wait_state("NORMAL")
    bench.silence(topics.MOVING)
    scene.wait_reason("WAY_UNSEEN")
    bench.repeat(topics.MOVING, around.bodies, 20.0)
    scene.wait_reason("")
    bench.silence(topics.UNSEEN_SPACE)
    scene.wait_reason("WAY_UNSEEN")
    around.frozen = True
    scene.wait_state("DEGRADED", "LIDAR_TIMEOUT")
    assert "frozen" in bench.log("safety_monitor")
    around.frozen = False
    scene.wait_state("NORMAL")
    silent_s = bench.now_s
    bench.silence(topics.OVERHEAD_LIDAR_POINTS)
    scene.wait_state("DEGRADED", "LIDAR_TIMEOUT")
    assert 0.2 <= first_s(scene.status, silent_s, lambda m: m.active_faults) <= 0.3 + TICK_S + LATENCY_S + SHOWN_S
    assert "/sensors/overhead_lidar/points" in bench.log("safety_monitor")
    bench.repeat(topics.OVERHEAD_LIDAR_POINTS, around.overhead, 10.0)
    scene.wait_state("NORMAL")
    silent_s = bench.now_s
    bench.silence(topics.OBSTACLES)
    scene.wait_state("DEGRADED", "OBSTACLES_TIMEOUT")
    assert 0.25 <= first_s(scene.status, silent_s, lambda m: m.active_faults) <= 0.3 + TICK_S + LATENCY_S + SHOWN_S
    assert math.isnan(scene.status.last.min_obstacle_distance)
