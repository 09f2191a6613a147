"""The swerve controller with ideal modules, a fake safety monitor and fake command sources."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, SwerveModuleCommandArray, VelocityLimit
from robot_stack.contract import services, topics
from robot_stack.contract.frames import JOINTS, MODULES, steering_link, wheel_link
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import Twist2
from robot_stack.core.robot import load_robot
from robot_stack.middleware.conversions import pose_from_msg, time_from_s, time_to_s, twist_to_msg
from tests.simulated.bench import COMPUTE_S, LATENCY_S, Bench
from tests.simulated.story import Received
from tests.support.urdf import Urdf

RADIUS_M = load_robot().wheel_radius_m
TICK_S = 0.05


class FakeModules:
    """Ideal modules that execute wheel commands without delay and report them as joint states."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self.speeds_mps = [0.0] * 4
        self.angles_rad = [0.0] * 4
        self.drive_rad = [0.0] * 4
        self._at_s = bench.stamp_s()

    def on_commands(self, message: SwerveModuleCommandArray) -> None:
        self._advance()
        self.speeds_mps = [module.drive_velocity for module in message.modules]
        self.angles_rad = [module.steering_angle for module in message.modules]

    def _advance(self) -> None:
        now_s = self._bench.stamp_s()
        for i in range(4):
            self.drive_rad[i] += self.speeds_mps[i] / RADIUS_M * (now_s - self._at_s)
        self._at_s = now_s

    def joint_states(self) -> JointState:
        self._advance()
        message = JointState(name=list(JOINTS))
        message.header.stamp = time_from_s(self._at_s)
        pairs = zip(self.drive_rad, self.angles_rad, strict=True)
        message.position = [value for pair in pairs for value in pair]
        message.velocity = [v for speed in self.speeds_mps for v in (speed / RADIUS_M, 0.0)]
        return message


def limit(speed_mps: float, yaw_rate_radps: float = 1.0, reason: str = "") -> VelocityLimit:
    return VelocityLimit(max_linear_velocity=speed_mps, max_angular_velocity=yaw_rate_radps, reason=reason)


def stamped(twist: Twist2, stamp_s: float = 0.0) -> TwistStamped:
    message = TwistStamped(twist=twist_to_msg(twist))
    message.header.stamp = time_from_s(stamp_s)
    return message


class World:
    """The surroundings of the controller: output is fed back, and all inputs are valid until a test changes them."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.modules = FakeModules(bench)
        self.commands = bench.listen(topics.WHEEL_COMMANDS, self.modules.on_commands)
        self.limited, self.odom, self.tf = (
            bench.listen(row) for row in (topics.CMD_VEL_LIMITED, topics.ODOM, topics.TF)
        )
        bench.publisher(topics.EMERGENCY_STOP)
        self.report_safety()
        self.report_limit(limit(1.5))
        self.node = bench.start("swerve_controller")
        bench.repeat(topics.JOINT_STATES, self.modules.joint_states, 50.0)
        self.commands.wait()

    def report_safety(self, state: str = SafetyStatus.NORMAL) -> None:
        self.bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state=state), 10.0)

    def report_limit(self, message: VelocityLimit) -> None:
        self.bench.repeat(topics.VELOCITY_LIMIT, lambda: message, 20.0)

    def navigate(self, twist: Twist2) -> None:
        self.bench.repeat(topics.CMD_VEL, lambda: twist_to_msg(twist), 20.0)

    def stop(self, pressed: bool) -> None:
        self.bench.publish(topics.EMERGENCY_STOP, Bool(data=pressed))

    def log(self) -> str:
        return self.bench.log("swerve_controller")

    def set_point(self) -> Twist2:
        twist = self.limited.last.twist
        return Twist2(twist.linear.x, twist.linear.y, twist.angular.z)

    def wait_speed(self, vx: float, limit_s: float = 10.0) -> None:
        self.limited.wait(lambda message: abs(message.twist.linear.x - vx) < 1e-6, f"{vx} m/s", limit_s)

    def drive(self, vx: float) -> None:
        self.navigate(Twist2(vx, 0.0, 0.0))
        self.wait_speed(vx)

    def assert_stays_at_zero(self, duration_s: float = 1.0) -> None:
        self.bench.run(0.1)
        begun_s = self.bench.now_s
        self.bench.run(duration_s)
        messages = self.commands.since(begun_s)
        assert len(messages) > 15.0 * duration_s
        assert all(is_zero(message) for message in messages)

    def braking(self, silent_s: float, vx: float) -> tuple[float, float]:
        """(s) From the last message to the first slower set point, and from that to standstill."""
        self.wait_speed(0.0)
        falling_s = [at_s for at_s, m in self.limited.items if at_s > silent_s and m.twist.linear.x < vx]
        stood_s = next(at_s for at_s, m in self.limited.items if at_s > silent_s and abs(m.twist.linear.x) < 1e-6)
        return falling_s[0] - silent_s, stood_s - falling_s[0]


@pytest.fixture
def world(bench: Bench) -> World:
    return World(bench)


def is_zero(message: SwerveModuleCommandArray) -> bool:
    return all(module.drive_velocity == 0.0 for module in message.modules)


def yaw_of(arrived: Received) -> float:
    return pose_from_msg(arrived.last.pose.pose).yaw


def test_a_ride_forward(world: World) -> None:
    world.drive(0.5)
    world.bench.run(3.0)
    for arrived, period_s in ((world.commands, 0.05), (world.limited, 0.05), (world.odom, 0.02)):
        stamps = [time_to_s(message.header.stamp) for message in arrived.messages[-41:]]
        steps = [later - earlier for earlier, later in itertools.pairwise(stamps)]
        assert steps == pytest.approx([period_s] * 40, abs=2.0 * COMPUTE_S), arrived
    assert [module.module_id for module in world.commands.last.modules] == [0, 1, 2, 3]
    assert [module.drive_velocity for module in world.commands.last.modules] == pytest.approx([0.5] * 4)
    assert world.commands.last.header.frame_id == "base_link"
    odom = world.odom.last
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
    assert odom.twist.twist.linear.x == pytest.approx(0.5, abs=1e-3)
    assert odom.pose.covariance[0] > 0.0
    transform = world.tf.last.transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert transform.transform.translation.x > 1.5


def test_transforms_of_the_modules_are_those_of_the_description(world: World) -> None:
    """As robot_state_publisher makes them from /robot_description and /joint_states."""
    text = world.bench.listen(topics.ROBOT_DESCRIPTION).wait().data
    joints = world.bench.listen(topics.JOINT_STATES)
    world.navigate(Twist2(0.4, 0.3, 0.5))
    world.bench.run(2.03)
    tf = world.tf.last
    angles = next(m for m in joints.messages if m.header.stamp == tf.transforms[0].header.stamp)
    assert {t.header.stamp.nanosec for t in tf.transforms} == {angles.header.stamp.nanosec}
    expected = Urdf(text).link_poses(dict(zip(angles.name, angles.position, strict=True)))
    poses = {"odom": np.eye(4)}
    for item in tf.transforms:
        shift, turn = item.transform.translation, item.transform.rotation
        step = np.eye(4)
        step[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        step[:3, 3] = shift.x, shift.y, shift.z
        poses[item.child_frame_id] = poses[item.header.frame_id] @ step
    moving = [frame(module) for module in MODULES for frame in (steering_link, wheel_link)]
    assert sorted(poses) == sorted([*moving, "odom", "base_link"])
    for link in moving:
        assert np.linalg.solve(poses["base_link"], poses[link]) == pytest.approx(expected[link], abs=1e-6), link
    assert max(abs(angle) for angle in angles.position) > 1.0


# --- stop ------------------------------------------------------------------------------------------------------------


def test_emergency_stop_is_a_zero_command_at_once(world: World) -> None:
    """At every phase of the tick of 50 ms."""
    for phase in range(5):
        world.drive(0.3)
        world.bench.run(0.05 + 0.01 * phase)
        pressed_s = world.bench.now_s
        world.stop(True)
        world.bench.run(0.1)
        arrived_s = next(at_s for at_s, message in world.commands.items if at_s > pressed_s and is_zero(message))
        # The loop may be busy with a wake-up.
        assert arrived_s - pressed_s <= 2.0 * (LATENCY_S + COMPUTE_S) + 1e-6
        assert all(is_zero(message) for message in world.commands.since(arrived_s))
        world.report_safety(SafetyStatus.EMERGENCY_STOP)
        world.bench.run(0.1)
        world.stop(False)
        world.bench.run(0.1)
        world.report_safety()
        world.navigate(Twist2(0.0, 0.0, 0.0))
        world.bench.run(0.2)


def test_release_needs_both_keys(world: World) -> None:
    world.drive(0.3)
    world.stop(True)
    world.bench.run(0.1)
    world.stop(False)
    world.assert_stays_at_zero()  # the monitor has not received it yet
    world.report_safety(SafetyStatus.EMERGENCY_STOP)
    world.assert_stays_at_zero()
    world.report_safety()
    world.assert_stays_at_zero()
    assert "ask for standstill first" in world.log()
    world.navigate(Twist2(0.0, 0.0, 0.0))
    world.bench.run(0.2)
    world.drive(0.3)


def test_silence_of_the_commands_is_a_gentle_stop(world: World) -> None:
    world.drive(0.4)
    silent_s = world.bench.now_s
    world.bench.silence(topics.CMD_VEL)
    began_s, took_s = world.braking(silent_s, 0.4)
    stale_s = topics.CMD_VEL.stale_limit_s
    assert stale_s - 0.05 <= began_s <= stale_s + TICK_S + 0.01  # the newest command is up to 50 ms older
    assert 0.6 < took_s < 1.2  # 1.0 m/s2 and 2.0 m/s3; the emergency deceleration would take 0.2 s
    world.commands.wait(is_zero, "wheels commanded to stand", 0.1)


@pytest.mark.parametrize("how", ["silent", "not finite"])
def test_silence_of_usable_joint_states_brakes_hard(world: World, how: str) -> None:
    def bad() -> JointState:
        message = world.modules.joint_states()
        message.position[3] = math.nan
        return message

    world.drive(0.9)
    silent_s = world.bench.now_s
    world.bench.silence(topics.JOINT_STATES)
    if how == "not finite":
        world.bench.repeat(topics.JOINT_STATES, bad, 50.0)
    began_s, took_s = world.braking(silent_s, 0.9)
    assert 0.08 <= began_s <= 0.1 + TICK_S + LATENCY_S + COMPUTE_S + 0.02
    assert took_s <= 0.9 / 2.0 + TICK_S + COMPUTE_S  # the normal deceleration takes 1.5 s


@pytest.mark.parametrize(
    ("row", "stale_s", "says"),
    [
        (topics.SAFETY_STATUS, 0.5, "no usable /safety/status for 0.5 s"),
        (topics.VELOCITY_LIMIT, 0.18, "no usable /safety/velocity_limit for 0.18 s"),
    ],
    ids=["status", "limit"],
)
def test_silence_of_the_safety_monitor_brakes_hard(world: World, row: Topic, stale_s: float, says: str) -> None:
    world.drive(0.9)
    silent_s = world.bench.now_s
    world.bench.silence(row)
    began_s, took_s = world.braking(silent_s, 0.9)
    assert stale_s - 0.1 < began_s < stale_s + 2.0 * TICK_S  # the newest message is up to 0.1 s older
    assert took_s <= 0.9 / 2.0 + TICK_S + COMPUTE_S  # the normal deceleration takes 1.4 s
    assert says in world.log()
    world.report_safety()
    world.report_limit(limit(1.5))
    world.wait_speed(0.9)


@pytest.mark.parametrize("after_s", [0.005, 0.02, 0.035])
def test_a_hard_stop_does_not_wait_for_the_tick(world: World, after_s: float) -> None:
    world.drive(0.9)
    world.bench.silence(topics.VELOCITY_LIMIT)
    world.limited.wait_next()
    world.bench.run(after_s)
    asked_s = world.bench.now_s
    world.report_limit(limit(0.0, 0.0, "SIGHT_STALE"))
    began_s, took_s = world.braking(asked_s, 0.9)
    assert began_s < 2.0 * LATENCY_S + COMPUTE_S + 0.002
    assert took_s == pytest.approx(0.9 / 2.0 - TICK_S, abs=TICK_S)  # the first set point is one period ahead
    first_mps = next(m.twist.linear.x for at_s, m in world.limited.items if at_s > asked_s)
    assert first_mps == pytest.approx(0.9 - 2.0 * TICK_S)


def test_repeated_hard_stops_keep_the_deceleration(world: World) -> None:
    world.drive(0.9)
    asked_s = world.bench.now_s
    world.bench.repeat(topics.VELOCITY_LIMIT, lambda: limit(0.0, 0.0, "SIGHT_STALE"), 200.0)
    _, took_s = world.braking(asked_s, 0.9)
    assert took_s > 0.9 / 2.0 - 2.0 * TICK_S
    begun = len(world.commands.items)
    world.bench.run(1.0)
    assert len(world.commands.items) - begun <= 21  # a standing robot is commanded at ticks only


# --- limits ----------------------------------------------------------------------------------------------------------


def test_speed_limit_and_its_end(world: World) -> None:
    world.drive(0.6)
    world.report_limit(limit(0.25, 0.5, "SLOPE"))
    world.wait_speed(0.25)
    world.report_limit(limit(0.0, 0.0, "LOCALIZATION_LOST"))
    world.wait_speed(0.0)
    world.report_limit(limit(math.nan, math.nan))
    world.assert_stays_at_zero()
    world.report_limit(limit(1.5))
    world.wait_speed(0.6)


def test_passenger_is_driven_gently_and_slowly(world: World) -> None:
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    world.bench.run(0.1)
    world.navigate(Twist2(5.0, 0.0, 0.0))
    world.wait_speed(1.0)
    arrived = world.limited.messages
    accelerations = [
        (later.twist.linear.x - earlier.twist.linear.x)
        / (time_to_s(later.header.stamp) - time_to_s(earlier.header.stamp))
        for earlier, later in zip(arrived, arrived[10:], strict=False)
    ]
    assert max(accelerations) == pytest.approx(0.5, abs=0.01)


def test_command_that_is_not_finite_stops_and_a_huge_one_is_clamped(world: World) -> None:
    world.drive(0.3)
    world.navigate(Twist2(0.3, math.nan, 0.0))
    world.wait_speed(0.0)
    assert "navigation command refused: linear.y must be finite, is nan" in world.log()
    world.navigate(Twist2(1.7e308, 0.0, 1.7e308))  # finite, but its norm is not
    world.bench.run(2.0)
    fastest_mps = max(message.twist.linear.x for message in world.limited.messages)
    assert 0.3 < fastest_mps <= 1.5 + 1e-9


# --- sources ---------------------------------------------------------------------------------------------------------


def test_teleop_has_priority_over_docking_over_navigation(world: World) -> None:
    def teleop() -> Any:
        return stamped(Twist2(-0.2, 0.0, 0.0), world.bench.stamp_s())

    world.drive(0.3)
    world.bench.repeat(topics.DOCKING_CMD_VEL, lambda: stamped(Twist2(0.1, 0.0, 0.0)), 20.0)
    world.wait_speed(0.1)
    world.bench.repeat(topics.TELEOP_CMD_VEL, teleop, 20.0)
    world.wait_speed(-0.2)
    world.bench.silence(topics.TELEOP_CMD_VEL)
    world.wait_speed(0.1)
    world.bench.silence(topics.DOCKING_CMD_VEL)
    world.wait_speed(0.3)


def test_stale_stamped_command_is_refused(world: World) -> None:
    late = Twist2(0.2, 0.0, 0.0)
    world.bench.repeat(topics.TELEOP_CMD_VEL, lambda: stamped(late, world.bench.stamp_s() - 1.0), 20.0)
    world.assert_stays_at_zero()
    assert "teleop command refused: 1.0" in world.log()


# --- service and node life --------------------------------------------------------------------------------------------


def test_odometry_is_reset_only_at_rest(world: World) -> None:
    world.drive(0.4)
    refused = world.bench.call(services.RESET_ODOMETRY)
    assert (refused.success, refused.message) == (False, "refused: the robot is moving")
    world.drive(0.0)
    world.bench.run(0.2)
    assert world.odom.last.pose.pose.position.x > 0.05
    assert world.bench.call(services.RESET_ODOMETRY).success
    world.bench.run(0.1)
    assert world.odom.last.pose.pose.position.x == pytest.approx(0.0, abs=1e-9)


def test_no_wheel_command_before_joint_states(bench: Bench) -> None:
    commands, limited = bench.listen(topics.WHEEL_COMMANDS), bench.listen(topics.CMD_VEL_LIMITED)
    bench.start("swerve_controller")
    bench.run(2.0)
    assert len(limited.items) >= 40
    assert commands.items == []


def test_end_leaves_a_zero_command(world: World) -> None:
    world.drive(0.5)
    assert world.bench.stop(world.node) == 0
    world.bench.run(0.1)
    assert is_zero(world.commands.last)
