"""The differential drive with a real engine process on virtual drives and a plain ROS client."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.runtime import runtime_dir
from robot_stack.supervisor import client
from robot_stack.supervisor.control import ask
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.protocol import SOCKET_FILE
from tests.support.braking import braking_s
from tests.support.peer import Heard, Peer
from tests.support.processes import ROOT, NodeProcess
from tests.support.waiting import wait_for
from wmx_ros2_message.srv import SetAxis

CONFIG = read_yaml(config_dir() / "diff_drive_controller.yaml")
RADIUS_M, TRACK_M = CONFIG["wheel_radius"], CONFIG["wheel_to_wheel"]
RAMP_S = 0.2
QUICK = ("-p", f"acc_time:={RAMP_S}", "-p", f"dec_time:={RAMP_S}")
BOTH = [0, 1]
# A stalled client looks silent, and silence is rest: streams that must not pause get a longer timeout.
STREAM = ("-p", "cmd_vel_timeout_s:=1.0")


def twist(linear_mps: float = 0.0, angular_radps: float = 0.0) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = linear_mps, angular_radps
    return message


class Rig:
    """Engine, node, and a client that uses only topics."""

    def __init__(self, start: Callable[..., NodeProcess], peer: Peer, folder: Path) -> None:
        self.start, self.peer = start, peer
        self.orders = folder / "orders.json"
        self.echo: Heard = peer.listen(topics.WMX_CMD_VEL_CHECK)
        self.speeds: Heard = peer.listen(topics.WMX_WHEEL_VELOCITIES)
        self.odometry: Heard = peer.listen(topics.WMX_ODOM_ENC)
        self.engine: NodeProcess | None = None
        self.node: NodeProcess | None = None
        self._view = StatusView(runtime_dir(), 5.0)
        self._device: MotionEngine | None = None

    def start_engine(self) -> None:
        not_before_ns = time.time_ns()
        script = ROOT / "tests" / "nodes" / "scripts" / "engine_process.py"
        self.engine = self.start("engine", command=[sys.executable, str(script), str(self.orders)])
        socket = runtime_dir() / SOCKET_FILE
        wait_for(lambda: socket.exists() and socket.stat().st_ctime_ns >= not_before_ns, "the engine to listen", 60.0)
        self._view = StatusView(runtime_dir(), 5.0)  # an older one would still show the previous engine

    def start_node(self, *ros_args: str) -> NodeProcess:
        self.node = self.start("diff_drive_controller", *QUICK, *ros_args)
        self.peer.wait_matched(topics.WMX_CMD_VEL)
        self.peer.wait_matched(topics.EMERGENCY_STOP)
        return self.node

    def ready(self, *ros_args: str) -> Rig:
        """Ready after a zero command, which the node requires because it may not have discovered all senders yet."""
        self.start_engine()
        self.start_node(*ros_args)
        self.wait_ready()
        self.centre()
        self.peer.silence(topics.WMX_CMD_VEL)
        return self

    def centre(self) -> None:
        """Commands zero until the node accepts commands."""
        self.drive(0.0)
        records = NodeRecords()
        assert self.node is not None
        pid = self.node.pid

        def obeys() -> bool:
            said = records.read("diff_drive_controller")
            return said is not None and said.pid == pid and said.ready

        wait_for(obeys, "a node that takes commands")
        self.pass_s(0.3)

    def wait_ready(self) -> None:
        self.wait_status(lambda s: s.communicating and s.servo_on.all() and (s.command_mode == 1).all(), "wheels ready")

    def device(self) -> MotionEngine:
        """Another client of the engine, like the general node."""
        self._device = self._device or connect("test", timeout_s=30.0)
        return self._device

    def close(self) -> None:
        if self.node is not None:
            self.node.stop()
        if self._device is not None:
            self._device.close()

    # operations of the client

    def drive(self, linear_mps: float = 0.0, angular_radps: float = 0.0) -> None:
        self.peer.repeat(topics.WMX_CMD_VEL, lambda: twist(linear_mps, angular_radps), 20.0)

    def set_out(self, linear_mps: float) -> None:
        """Commands zero, then the speed, and repeats this until the wheels turn. The node may not have detected the
        ready drive yet, and it ignores commands from before.
        """
        radps = linear_mps / RADIUS_M

        def turning() -> bool:
            self.drive(0.0)
            self.pass_s(0.3)
            self.drive(linear_mps)
            self.pass_s(1.0)
            return bool((abs(self._view.read()[1].velocity_cmd - radps) < 1e-6).all())

        wait_for(turning, f"wheels told to turn at {radps:.2f} rad/s")
        self.wait_wheels(radps, radps)

    def pass_s(self, seconds: float) -> None:
        """Waits for a duration of the engine's time."""
        end_s = self.wait_status(lambda s: True, "a status").engine_time_s + seconds
        self.wait_status(lambda s: s.engine_time_s > end_s, f"{seconds} s of the engine")

    def press(self, pressed: bool = True) -> None:
        self.peer.publish(topics.EMERGENCY_STOP, Bool(data=pressed))

    # the engine's status, read without the node

    def wait_status(self, holds: Callable[[StatusSnapshot], object], what: str) -> StatusSnapshot:
        def look() -> StatusSnapshot | None:
            code, snapshot = self._view.read()
            return snapshot if not code and snapshot.n_axes and holds(snapshot) else None

        found = wait_for(look, what, poll_s=0.002)
        assert found is not None
        return found

    def wait_wheels(self, left_radps: float, right_radps: float) -> StatusSnapshot:
        def turn(snapshot: StatusSnapshot) -> bool:
            left, right = snapshot.actual_velocity.tolist()
            return abs(left - left_radps) < 0.02 and abs(right - right_radps) < 0.02

        return self.wait_status(turn, f"wheels at {left_radps:.2f}, {right_radps:.2f} rad/s")

    def wait_rest(self) -> StatusSnapshot:
        return self.wait_status(
            lambda s: not s.velocity_cmd.any() and (abs(s.actual_velocity) < 0.02).all(), "wheels at rest"
        )

    def stays_at_rest(self) -> None:
        start_s = self.wait_rest().engine_time_s
        seen = self.wait_status(
            lambda s: s.velocity_cmd.any() or s.engine_time_s > start_s + 0.3, "0.3 s of the engine"
        )
        assert not seen.velocity_cmd.any()


@pytest.fixture
def rig(
    start: Callable[..., NodeProcess], peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Rig]:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_diff_drive")
    rig = Rig(start, peer, tmp_path)
    yield rig
    rig.close()


# --- the documented topics -----------------------------------------------------------------------------------


def test_documented_topics(rig: Rig) -> None:
    """An engine that starts late, kinematics, echo, measured speeds and odometry."""
    node = rig.start_node()
    node.wait_output("waiting for the motion engine")
    assert rig.speeds.items == rig.odometry.items == []
    rig.start_engine()
    rig.wait_ready()

    rig.centre()
    rig.drive(0.45, 0.6)
    left, right = (0.45 - 0.3 * TRACK_M) / RADIUS_M, (0.45 + 0.3 * TRACK_M) / RADIUS_M
    rig.wait_wheels(left, right)
    assert rig.echo.last == twist(0.45, 0.6)
    speeds = rig.speeds.wait(lambda m: abs(m.data[1] - right) < 0.05, "measured speeds")
    assert list(speeds.data) == pytest.approx([left, right], abs=0.05)

    def moving(message: Odometry) -> bool:
        return abs(message.twist.twist.angular.z - 0.6) < 0.02

    odometry: Odometry = rig.odometry.wait(moving, "measured twist")
    assert odometry.twist.twist.linear.x == pytest.approx(0.45, abs=0.02)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert odometry.pose == Odometry().pose, "no pose unless it is asked for"
    assert odometry.twist.covariance[0] > 0.0


def stamped(linear_mps: float, stamp: Any) -> TwistStamped:
    message = TwistStamped(twist=twist(linear_mps))
    message.header.stamp = stamp
    return message


def test_stamped_twists_and_limits_of_acceleration(rig: Rig) -> None:
    """0.9 m/s at 1 m/s2, where the engine's own ramp takes 0.2 s."""
    node = rig.ready("-p", "limits.linear_acceleration_mps2:=1.0", "-p", "limits.linear_jerk_mps3:=10.0").node
    assert node is not None
    clock = rig.peer.node.get_clock()
    rig.peer.repeat(topics.WMX_CMD_VEL_STAMPED, lambda: stamped(0.9, clock.now().to_msg()), 20.0)
    begin = rig.wait_status(lambda s: s.velocity_cmd[0] > 0.1 / RADIUS_M, "wheels speeding up")
    end = rig.wait_status(lambda s: s.velocity_cmd[0] > 0.8 / RADIUS_M, "wheels nearly as fast as asked for")
    gained_mps = RADIUS_M * float(end.velocity_cmd[0] - begin.velocity_cmd[0])
    assert gained_mps < 1.15 * (end.engine_time_s - begin.engine_time_s), "more than 1 m/s2"
    rig.wait_wheels(0.9 / RADIUS_M, 0.9 / RADIUS_M)
    # The end of a limited change is slow, and must not be measured as part of the stop.
    rig.wait_status(lambda s: abs(s.velocity_cmd[0] - 0.9 / RADIUS_M) < 1e-6, "the whole speed")
    assert rig.echo.last == twist(0.9)

    # old commands are dropped, which counts as silence: a stop without the limit, by which it would take 0.9 s. Its
    # ramp is tested in tests/unit/wmx/differential: here a delayed node's last command may end by itself first.
    rig.peer.repeat(topics.WMX_CMD_VEL_STAMPED, lambda: stamped(0.9, Time(sec=1)), 20.0)
    assert braking_s(rig.wait_status, 0, 0.9 / RADIUS_M) < 0.9
    node.wait_output("/diff_drive_controller/cmd_vel left out: it is ")

    # a stamp of zero means now
    rig.peer.repeat(topics.WMX_CMD_VEL_STAMPED, lambda: stamped(0.3, Time()), 20.0)
    rig.wait_wheels(0.3 / RADIUS_M, 0.3 / RADIUS_M)


# --- stops -----------------------------------------------------------------------------------------------------


def test_emergency_stop_without_and_with_a_safety_monitor(rig: Rig) -> None:
    rig.ready("-p", "dec_time:=5.0", "-p", "end_timeout_s:=0.2", *STREAM)
    rig.drive(0.9)
    rig.wait_wheels(0.9 / RADIUS_M, 0.9 / RADIUS_M)
    rig.press()
    begin = rig.wait_status(lambda s: s.velocity_cmd[0] < 0.89 / RADIUS_M, "wheels slowing down")
    end = rig.wait_rest()
    # 10 rad/s at the engine's quick stop of 25 rad/s2; the command's own ramp takes 5 s.
    assert end.engine_time_s - begin.engine_time_s < 1.0
    rig.stays_at_rest()

    rig.press(False)  # without any /safety/status, false is the release
    rig.stays_at_rest()  # the twist has not been zero yet
    assert rig.node is not None
    rig.node.wait_output("waiting for a zero command or a command timeout")
    rig.drive(0.0)
    rig.stays_at_rest()
    rig.drive(0.3)
    rig.wait_wheels(0.3 / RADIUS_M, 0.3 / RADIUS_M)

    emergency = SafetyStatus(safety_state=SafetyStatus.EMERGENCY_STOP)
    rig.peer.repeat(topics.SAFETY_STATUS, lambda: emergency, 20.0)
    rig.wait_rest()
    rig.press(False)
    rig.drive(0.0)
    rig.stays_at_rest()
    rig.drive(0.3)
    rig.stays_at_rest()  # the monitor has not released
    rig.peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state=SafetyStatus.NORMAL), 20.0)
    rig.stays_at_rest()
    rig.peer.silence(topics.WMX_CMD_VEL)
    rig.pass_s(1.5)
    rig.stays_at_rest()
    rig.drive(0.3)
    rig.wait_wheels(0.3 / RADIUS_M, 0.3 / RADIUS_M)


def test_hung_node_killed_node_killed_engine_and_orderly_end(rig: Rig) -> None:
    rig.ready(*STREAM)
    rig.device()  # the engine outlives the node
    rig.drive(0.5)
    rig.wait_wheels(0.5 / RADIUS_M, 0.5 / RADIUS_M)
    assert rig.node is not None
    rig.node.signal(signal.SIGSTOP)  # the engine's watchdog detects the hanging node
    rig.wait_rest()
    rig.node.signal(signal.SIGCONT)
    rig.stays_at_rest()
    rig.set_out(0.5)
    rig.node.process.kill()
    rig.node.process.wait()
    rig.wait_rest()

    node = rig.start_node(*STREAM)
    rig.stays_at_rest()  # the stream of twists began before the node
    rig.set_out(0.5)
    assert rig.engine is not None
    rig.engine.process.kill()
    rig.engine.process.wait()
    node.wait_output("waiting for the motion engine")
    rig.drive(0.0)
    rig.start_engine()
    rig.wait_ready()
    rig.set_out(0.5)

    rig._device = None  # belongs to the dead engine
    rig.device()
    node.signal(signal.SIGTERM)
    assert braking_s(rig.wait_status, 0, 0.5 / RADIUS_M) == pytest.approx(RAMP_S, rel=0.02)
    assert node.wait() == 0
    rig.wait_status(lambda s: not s.servo_on.any(), "servos off")
    assert rig.device().read_status()[1].communicating, "the bus belongs to all"


# --- options -----------------------------------------------------------------------------------------------------


def test_pose_transform_polarity_and_names(rig: Rig) -> None:
    """A base with an inverted right axis, turned by 180 deg to the left, under other names."""
    other = {
        "cmd_vel_topic": "/base/twist",
        "encoder_omega_topic": "/base/wheels",
        "encoder_odometry_topic": "/base/odom",
    }
    options = {"publish_pose": "true", "publish_tf": "true", "right_polarity": "-1", "odom_frame": "world"}
    ros_args = [text for name, value in (other | options).items() for text in ("-p", f"{name}:={value}")]
    ros_args += ["-p", "encoder_vel_topic:=/diff_drive/no_param"]
    commands = rig.peer.node.create_publisher(Twist, "/base/twist", 1)
    poses: list[Odometry] = []
    rig.peer.node.create_subscription(Odometry, "/base/odom", poses.append, 1)
    transforms = rig.peer.listen(topics.WMX_TF)
    rig.start_engine()
    rig.node = rig.start("diff_drive_controller", *QUICK, *ros_args)
    wait_for(lambda: commands.get_subscription_count() == 1, "the renamed subscriber")
    rig.wait_ready()

    def names() -> set[str]:
        return {name for name, _ in rig.peer.node.get_topic_names_and_types()}

    wait_for(lambda: "/base/wheels" in names(), "the renamed topic of wheel speeds")
    assert not any("no_param" in name for name in names())

    commands.publish(twist())
    rig.pass_s(0.3)
    timer = rig.peer.node.create_timer(0.05, lambda: commands.publish(twist(0.3, 1.0)))
    wheel = (0.3 - 0.5 * TRACK_M) / RADIUS_M, -(0.3 + 0.5 * TRACK_M) / RADIUS_M
    rig.wait_wheels(*wheel)
    wait_for(lambda: poses and poses[-1].pose.pose.orientation.z > 0.5, "a turn to the left")
    rig.peer.node.destroy_timer(timer)
    rest = rig.wait_rest()
    left_rad, right_rad = rest.actual_pos[0], -rest.actual_pos[1]
    yaw = (right_rad - left_rad) * RADIUS_M / TRACK_M
    wait_for(lambda: abs(poses[-1].twist.twist.angular.z) < 1e-6, "odometry at rest")
    pose = poses[-1].pose.pose
    assert 2.0 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(yaw, abs=1e-3)
    # Both wheels change in equal times, so the ratio of their speeds and thus the circle is constant.
    circle_m = 0.3
    assert pose.position.x == pytest.approx(circle_m * math.sin(yaw), abs=0.02)
    assert pose.position.y == pytest.approx(circle_m * (1.0 - math.cos(yaw)), abs=0.02)
    assert poses[-1].pose.covariance[35] > 0.0
    transform = transforms.wait(
        lambda m: abs(m.transforms[0].transform.translation.x - pose.position.x) < 1e-6, "the transform at rest"
    ).transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "base_link")


def test_profile_with_the_general_node_that_clears_alarms(ros_domain: int, peer: Peer, tmp_path: Path) -> None:
    """An operator's sequence: start, drive, an alarm, clear_alarm and set_on by service, drive on."""
    settings = [f"diff_drive_controller.{name}={RAMP_S}" for name in ("acc_time", "dec_time")]
    speeds = peer.listen(topics.WMX_WHEEL_VELOCITIES)
    try:
        status = client.start(client.Launch("diff_drive", settings=settings, log_dir=tmp_path / "logs"), 90.0)
        assert status["ready"]
        assert not status["missing"]
        turning = 0.5 / RADIUS_M
        peer.repeat(topics.WMX_CMD_VEL, twist, 20.0)
        peer.wait_matched(topics.WMX_CMD_VEL)
        begun = len(speeds.items)
        wait_for(lambda: len(speeds.items) > begun + 100, "a second with the stick in its middle")
        peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.5), 20.0)
        speeds.wait(lambda m: m.data[0] == pytest.approx(turning, abs=0.1), "wheels turning")
        alarm = InjectFault.Request(kind="drive_alarm", target="left_wheel", duration_s=0.1)
        assert peer.call(services.INJECT_ENGINE_FAULT, alarm).success
        speeds.wait(lambda m: list(m.data) == pytest.approx([0.0, 0.0], abs=0.02), "both wheels at rest")
        wait_for(lambda: not ask("status")["ready"], "the fault in the status")
        peer.repeat(topics.WMX_CMD_VEL, twist, 20.0)
        axis = {"index": [0], "data": [1]}
        cleared = peer.call(services.AXIS_CLEAR_ALARM, SetAxis.Request(**axis))
        assert cleared.message == "Cleared alarm axis 0; "
        assert peer.call(services.AXIS_SET_ON, SetAxis.Request(**axis)).message == "Set axis 0 on; "
        wait_for(lambda: ask("status")["ready"], "the base to be ready again")
        peer.repeat(topics.WMX_CMD_VEL, lambda: twist(0.5), 20.0)
        speeds.wait(lambda m: m.data[0] == pytest.approx(turning, abs=0.1), "wheels turning again")
    finally:
        client.stop()
