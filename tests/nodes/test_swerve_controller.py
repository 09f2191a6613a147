"""The swerve controller among a fake hardware interface, a fake safety monitor and fake sources of commands."""

from __future__ import annotations

import itertools
import math
import signal
import statistics
import time
from collections.abc import Callable

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, SwerveModuleCommandArray, VelocityLimit
from robot_stack.contract import services, topics
from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import Topic
from robot_stack.core.geometry import Twist2
from robot_stack.core.robot import load_robot
from robot_stack.middleware.conversions import pose_from_msg, time_from_s, time_to_s, twist_to_msg
from tests.support.held_up import HeldUp
from tests.support.peer import Heard, Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

RADIUS_M = load_robot().wheel_radius_m


class FakeModules:
    """Ideal modules: they do at once what the wheel commands say, and report it as joint states."""

    def __init__(self) -> None:
        self.speeds_mps = [0.0] * 4
        self.angles_rad = [0.0] * 4
        self.drive_rad = [0.0] * 4
        self._at_s = time.time()

    def on_commands(self, message: SwerveModuleCommandArray) -> None:
        self._advance()
        self.speeds_mps = [module.drive_velocity for module in message.modules]
        self.angles_rad = [module.steering_angle for module in message.modules]

    def _advance(self) -> None:
        now_s = time.time()
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


def safety_status(state: str = SafetyStatus.NORMAL) -> SafetyStatus:
    return SafetyStatus(safety_state=state)


def limit(speed_mps: float, yaw_rate_radps: float = 1.0, reason: str = "") -> VelocityLimit:
    return VelocityLimit(max_linear_velocity=speed_mps, max_angular_velocity=yaw_rate_radps, reason=reason)


def stamped(twist: Twist2, stamp_s: float = 0.0) -> TwistStamped:
    message = TwistStamped(twist=twist_to_msg(twist))
    message.header.stamp = time_from_s(stamp_s)
    return message


class World:
    """What the controller meets: its output is fed back, all inputs are well until a test says otherwise."""

    def __init__(self, node: NodeProcess, peer: Peer) -> None:
        self.node, self.peer = node, peer
        self.modules = FakeModules()
        self.commands: Heard = peer.listen(topics.WHEEL_COMMANDS, self.modules.on_commands)
        self.limited = peer.listen(topics.CMD_VEL_LIMITED)
        self.odom = peer.listen(topics.ODOM)
        self.tf = peer.listen(topics.TF)
        for row in (topics.JOINT_STATES, topics.CMD_VEL, topics.SAFETY_STATUS, topics.VELOCITY_LIMIT):
            peer.wait_matched(row)
        self.report_safety()
        self.report_limit(limit(1.5))
        peer.repeat(topics.JOINT_STATES, self.modules.joint_states, 50.0)
        self.commands.wait(lambda _: True, "wheel commands")

    def report_safety(self, state: str = SafetyStatus.NORMAL) -> None:
        self.peer.repeat(topics.SAFETY_STATUS, lambda: safety_status(state), 10.0)

    def report_limit(self, message: VelocityLimit) -> None:
        self.peer.repeat(topics.VELOCITY_LIMIT, lambda: message, 10.0)

    def navigate(self, twist: Twist2) -> None:
        self.peer.repeat(topics.CMD_VEL, lambda: twist_to_msg(twist), 20.0)

    def set_point(self) -> Twist2:
        twist = self.limited.last.twist
        return Twist2(twist.linear.x, twist.linear.y, twist.angular.z)

    def wait_speed(self, vx: float, what: str = "") -> None:
        self.limited.wait(lambda message: abs(message.twist.linear.x - vx) < 1e-6, what or f"a set point of {vx} m/s")

    def drive(self, vx: float) -> None:
        self.navigate(Twist2(vx, 0.0, 0.0))
        self.wait_speed(vx)


@pytest.fixture
def world(start: Callable[..., NodeProcess], peer: Peer) -> World:
    return World(start("swerve_controller"), peer)


def is_zero(message: SwerveModuleCommandArray) -> bool:
    return all(module.drive_velocity == 0.0 for module in message.modules)


def period_s(heard: Heard) -> float:
    """Median distance of the stamps: messages that this process was too late for do not count."""
    stamps = [time_to_s(message.header.stamp) for message in heard.messages]
    return statistics.median(after - before for before, after in itertools.pairwise(stamps))


def test_a_ride_forward(world: World) -> None:
    world.drive(0.5)
    for heard in (world.commands, world.limited, world.odom):
        heard.items.clear()
    wait_for(lambda: len(world.commands.items) >= 41, "41 wheel commands")
    assert period_s(world.commands) == pytest.approx(0.05, rel=0.02)
    assert period_s(world.limited) == pytest.approx(0.05, rel=0.02)
    assert period_s(world.odom) == pytest.approx(0.02, rel=0.1)  # the stamps are the peer's
    assert [module.module_id for module in world.commands.last.modules] == [0, 1, 2, 3]
    assert [module.drive_velocity for module in world.commands.last.modules] == pytest.approx([0.5] * 4)
    assert world.commands.last.header.frame_id == "base_link"
    odom = world.odom.last
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
    assert odom.twist.twist.linear.x == pytest.approx(0.5, abs=0.02)
    assert odom.pose.covariance[0] > 0.0
    transform = world.tf.last.transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert transform.transform.translation.x > 0.5


def test_odometry_agrees_with_the_modules_after_a_turn_and_a_sideways_ride(world: World) -> None:
    """Ideal modules: where the odometry ends is where the wheels have rolled."""
    world.navigate(Twist2(0.0, 0.0, 0.8))
    wait_for(lambda: world.odom.items and yaw_of(world.odom) > 1.0, "a turn of 1 rad")
    world.navigate(Twist2(0.0, 0.5, 0.0))
    wait_for(lambda: abs(world.set_point().vy - 0.5) < 1e-6, "a sideways ride")
    world.navigate(Twist2(0.0, 0.0, 0.0))
    world.limited.wait(lambda message: message.twist == Twist(), "standstill")
    count = len(world.odom.items)
    wait_for(lambda: len(world.odom.items) > count + 5, "odometry at rest")
    last = world.odom.last
    assert last.twist.twist.linear.y == pytest.approx(0.0, abs=1e-9)
    pose = last.pose.pose.position
    assert math.hypot(pose.x, pose.y) > 0.2
    # Sideways at this yaw: the way is perpendicular to the heading at the start of the sideways ride.
    assert abs(math.remainder(math.atan2(pose.y, pose.x) - (yaw_of(world.odom) + math.pi / 2), 2 * math.pi)) < 0.5


def yaw_of(heard: Heard) -> float:
    return pose_from_msg(heard.last.pose.pose).yaw


# --- stop ------------------------------------------------------------------------------------------------------------


def test_emergency_stop_is_a_zero_command_at_once(world: World) -> None:
    """Not at the next tick: half of the ticks would be more than 25 ms away."""
    world.peer.wait_matched(topics.EMERGENCY_STOP)
    delays_ms = []
    for _ in range(7):
        world.drive(0.3)
        world.commands.items.clear()
        pressed_s = time.monotonic()
        world.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
        world.commands.wait(is_zero, "a zero command")
        arrived_s = next(at_s for at_s, message in world.commands.items if is_zero(message))
        delays_ms.append(1e3 * (arrived_s - pressed_s))
        world.report_safety(SafetyStatus.EMERGENCY_STOP)
        wait_for(lambda: all(is_zero(m) for m in world.commands.messages[-5:]), "standstill")
        world.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
        wait_status(world)
        world.report_safety()
        world.navigate(Twist2(0.0, 0.0, 0.0))
        wait_status(world)
    assert statistics.median(delays_ms) < 20.0


def wait_status(world: World) -> None:
    """Until the status that is published now must have been heard."""
    count = len(world.commands.items)
    wait_for(lambda: len(world.commands.items) > count + 6, "0.3 s of commands")


def test_release_needs_both_keys(world: World) -> None:
    world.drive(0.3)
    world.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    world.commands.wait(is_zero, "a zero command")
    world.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    assert_stays_at_zero(world)  # the monitor has not even seen it yet
    world.report_safety(SafetyStatus.EMERGENCY_STOP)
    assert_stays_at_zero(world)
    world.report_safety()
    # Not asserted for how long it stands: a sender that is held up for 0.2 s has fallen silent, which is rest.
    wait_for(lambda: "ask for standstill first" in world.node.output(), "the command of before must rest first")
    world.navigate(Twist2(0.0, 0.0, 0.0))
    wait_status(world)
    world.drive(0.3)


def test_status_alone_does_not_release(world: World) -> None:
    world.drive(0.3)
    world.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    world.report_safety(SafetyStatus.EMERGENCY_STOP)
    wait_status(world)
    world.report_safety()
    assert_stays_at_zero(world)


def assert_stays_at_zero(world: World) -> None:
    wait_status(world)
    world.commands.items.clear()
    wait_for(lambda: len(world.commands.items) >= 12, "0.6 s of commands")
    assert all(is_zero(message) for message in world.commands.messages)


def test_silence_of_the_commands_is_a_gentle_stop(world: World) -> None:
    world.drive(0.4)
    world.limited.items.clear()
    world.peer.silence(topics.CMD_VEL)
    world.wait_speed(0.0, "standstill")
    falling = [message for message in world.limited.messages if message.twist.linear.x < 0.4]
    took_s = time_to_s(falling[-1].header.stamp) - time_to_s(falling[0].header.stamp)
    assert took_s > 0.5  # 1.0 m/s2 and 2.0 m/s3; the emergency deceleration would take 0.2 s
    world.commands.wait(is_zero, "wheels commanded to stand")


def test_silence_of_the_joint_states_brakes_hard(world: World) -> None:
    world.drive(0.9)
    world.peer.silence(topics.JOINT_STATES)
    with HeldUp() as machine:
        silent_s = time.monotonic()
        world.wait_speed(0.0, "standstill")
        took_s = time.monotonic() - silent_s
    assert took_s - machine.seconds < 1.2  # 0.1 s + 0.9 / 2.0 s and some ticks; gently it would be 1.5 s


BAD_JOINT_STATES: dict[str, Callable[[JointState], None]] = {
    "position of fr_steer must be finite, is nan": lambda m: m.position.__setitem__(3, math.nan),
    "position must have 8 values, has 5": lambda m: setattr(m, "position", m.position[:5]),
    "name must be the 8 joints": lambda m: m.name.__setitem__(0, "wheel"),
}


def test_joint_states_that_cannot_be_used_count_as_silence(world: World) -> None:
    for says, broken in BAD_JOINT_STATES.items():
        world.peer.repeat(topics.JOINT_STATES, world.modules.joint_states, 50.0)
        world.drive(0.3)

        def bad(broken: Callable[[JointState], None] = broken) -> JointState:
            message = world.modules.joint_states()
            broken(message)
            return message

        world.peer.repeat(topics.JOINT_STATES, bad, 50.0)
        world.wait_speed(0.0, "standstill")
        world.node.wait_output(f"/joint_states refused: {says}")


@pytest.mark.parametrize(
    ("row", "says"),
    [
        (topics.SAFETY_STATUS, "no usable /safety/status for 0.5 s"),
        (topics.VELOCITY_LIMIT, "no usable /safety/velocity_limit for 0.25 s"),
    ],
    ids=["status", "limit"],
)
def test_silence_of_the_safety_monitor_brakes_hard(world: World, row: Topic, says: str) -> None:
    world.drive(0.9)
    world.limited.items.clear()
    with HeldUp() as machine:
        world.peer.silence(row)
        world.wait_speed(0.0, "standstill")
    falling = [message for message in world.limited.messages if message.twist.linear.x < 0.9]
    took_s = time_to_s(falling[-1].header.stamp) - time_to_s(falling[0].header.stamp)
    assert took_s - machine.seconds < 0.8  # 0.9 / 2.0 s and some ticks; gently it would be 1.4 s
    world.node.wait_output(says)
    world.report_safety()
    world.report_limit(limit(1.5))
    world.wait_speed(0.9)


# --- limits ----------------------------------------------------------------------------------------------------------


def test_speed_limit_and_its_end(world: World) -> None:
    world.drive(0.6)
    world.report_limit(limit(0.25, 0.5, "SLOPE"))
    world.wait_speed(0.25)
    world.report_limit(limit(0.0, 0.0, "LOCALIZATION_LOST"))
    world.wait_speed(0.0)
    world.report_limit(limit(math.nan, math.nan))
    wait_status(world)
    assert world.set_point().vx == 0.0
    world.report_limit(limit(1.5))
    world.wait_speed(0.6)


def test_passenger_is_driven_gently_and_slowly(world: World) -> None:
    world.peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    world.peer.wait_matched(topics.PASSENGER_ATTACHED)
    wait_status(world)
    world.navigate(Twist2(5.0, 0.0, 0.0))
    world.wait_speed(1.0)
    heard = world.limited.messages
    accelerations = [
        (later.twist.linear.x - earlier.twist.linear.x)
        / (time_to_s(later.header.stamp) - time_to_s(earlier.header.stamp))
        for earlier, later in zip(heard, heard[10:], strict=False)
    ]
    assert max(accelerations) == pytest.approx(0.5, abs=0.06)


def test_command_that_is_not_finite_stops_and_names_the_field(world: World) -> None:
    world.drive(0.3)
    world.navigate(Twist2(0.3, math.nan, 0.0))
    world.wait_speed(0.0)
    world.node.wait_output("navigation command refused: linear.y must be finite, is nan")
    world.navigate(Twist2(math.inf, 0.0, 0.0))
    assert_stays_at_zero(world)
    world.drive(0.3)


def test_huge_command_is_clamped(world: World) -> None:
    world.navigate(Twist2(1e308, 0.0, 0.0))
    world.wait_speed(1.5)


# --- sources ---------------------------------------------------------------------------------------------------------


def test_teleop_goes_before_docking_before_navigation(world: World) -> None:
    world.drive(0.3)
    world.peer.repeat(topics.DOCKING_CMD_VEL, lambda: stamped(Twist2(0.1, 0.0, 0.0)), 20.0)
    world.wait_speed(0.1)
    world.peer.repeat(topics.TELEOP_CMD_VEL, lambda: stamped(Twist2(-0.2, 0.0, 0.0), time.time()), 20.0)
    world.wait_speed(-0.2)
    world.peer.silence(topics.TELEOP_CMD_VEL)
    world.wait_speed(0.1)
    world.peer.silence(topics.DOCKING_CMD_VEL)
    world.wait_speed(0.3)


def test_stale_stamped_command_is_refused(world: World) -> None:
    world.peer.repeat(topics.TELEOP_CMD_VEL, lambda: stamped(Twist2(0.2, 0.0, 0.0), time.time() - 1.0), 20.0)
    world.node.wait_output("teleop command refused: 1.0")
    assert world.set_point() == Twist2(0.0, 0.0, 0.0)


# --- service and life ------------------------------------------------------------------------------------------------


def test_odometry_is_reset_only_at_rest(world: World) -> None:
    world.drive(0.4)
    refused = world.peer.call(services.RESET_ODOMETRY)
    assert (refused.success, refused.message) == (False, "refused: the robot is moving")
    world.drive(0.0)
    wait_for(lambda: world.odom.last.twist.twist.linear.x == 0.0, "odometry at rest")
    assert world.odom.last.pose.pose.position.x > 0.05
    assert world.peer.call(services.RESET_ODOMETRY).success
    count = len(world.odom.items)
    wait_for(lambda: len(world.odom.items) > count + 2, "odometry after the reset")
    assert world.odom.last.pose.pose.position.x == pytest.approx(0.0, abs=1e-9)


def test_no_wheel_command_before_the_modules_are_known(start: Callable[..., NodeProcess], peer: Peer) -> None:
    start("swerve_controller")
    commands, limited = peer.listen(topics.WHEEL_COMMANDS), peer.listen(topics.CMD_VEL_LIMITED)
    wait_for(lambda: len(limited.items) >= 10, "the controller's ticks")
    assert commands.items == []


def test_end_leaves_a_zero_command(world: World) -> None:
    world.drive(0.5)
    world.node.signal(signal.SIGTERM)
    assert world.node.wait() == 0
    world.commands.wait(is_zero, "a zero command at the end")


def test_second_controller_refuses_to_start(world: World, start: Callable[..., NodeProcess]) -> None:
    second = start("swerve_controller")
    assert second.wait() == 2
    assert "swerve_controller is already running" in second.output()


@pytest.mark.parametrize(
    ("argument", "says"),
    [
        ("odometry.slip_factor:=.nan", "odometry.slip_factor: Input should be"),
        ("no_such:=1", "no_such: is not a known parameter"),
    ],
)
def test_wrong_parameters_end_the_start(start: Callable[..., NodeProcess], argument: str, says: str) -> None:
    process = start("swerve_controller", "-p", argument)
    assert process.wait() == 2
    assert says in process.output()
