"""The differential drive with a real engine process on virtual drives and a plain ROS client."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.core.node_record import NodeRecords
from robot_stack.core.runtime import runtime_dir
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE
from robot_stack.wmx.simulated.channel import StatusView
from tests.support.braking import braking_s
from tests.support.engine import TestEngine
from tests.support.peer import Peer, Received
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for

CONFIG = read_yaml(config_dir() / "diff_drive_controller.yaml")
RADIUS_M, TRACK_M = CONFIG["wheel_radius"], CONFIG["wheel_to_wheel"]
RAMP_S = 0.2
SLOW_RAMP_S = 1.0  # is seen several times even by a test without processor time
QUICK = ("-p", f"acc_time:={RAMP_S}", "-p", f"dec_time:={RAMP_S}")
# A stalled client looks silent, and silence is rest: streams that must not pause get a longer timeout.
STREAM = ("-p", "cmd_vel_timeout_s:=1.0")


def twist(linear_mps: float = 0.0, angular_radps: float = 0.0) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = linear_mps, angular_radps
    return message


def stamped(linear_mps: float, stamp: Any) -> TwistStamped:
    message = TwistStamped(twist=twist(linear_mps))
    message.header.stamp = stamp
    return message


class Rig:
    """Engine, node, and a client that uses only topics."""

    def __init__(self, start: Start, peer: Peer, folder: Path) -> None:
        self.start, self.peer = start, peer
        self.echo: Received = peer.listen(topics.WMX_CMD_VEL_CHECK)
        self.speeds: Received = peer.listen(topics.WMX_WHEEL_VELOCITIES)
        self.odometry: Received = peer.listen(topics.WMX_ODOM_ENC)
        self.engine = TestEngine(start, folder)  # its device lets the engine outlive the node
        self.node: NodeProcess | None = None
        self._view = StatusView(runtime_dir(), 5.0)

    def start_engine(self) -> None:
        self.engine.close()
        self.engine.run()
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

    def close(self) -> None:
        if self.node is not None:
            self.node.stop()
        self.engine.close()

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

        wait_for(turning, f"wheels commanded to turn at {radps:.2f} rad/s")
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
def rig(start: Start, peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_diff_drive")
    rig = Rig(start, peer, tmp_path)
    yield rig
    rig.close()


# --- the documented topics -----------------------------------------------------------------------------------


def test_documented_topics(rig: Rig) -> None:
    """An engine that starts late, kinematics, echo, measured speeds, odometry and stamped twists."""
    node = rig.start_node()
    node.wait_output("waiting for the motion engine")
    assert rig.speeds.items == rig.odometry.items == []
    rig.start_engine()
    rig.wait_ready()

    rig.centre()
    rig.drive(0.45, 0.6)
    left, right = (0.45 - 0.3 * TRACK_M) / RADIUS_M, (0.45 + 0.3 * TRACK_M) / RADIUS_M
    rig.wait_wheels(left, right)
    rig.echo.wait(lambda m: m == twist(0.45, 0.6), "the echo")
    speeds = rig.speeds.wait(lambda m: abs(m.data[1] - right) < 0.05, "measured speeds")
    assert list(speeds.data) == pytest.approx([left, right], abs=0.05)

    def moving(message: Odometry) -> bool:
        return abs(message.twist.twist.angular.z - 0.6) < 0.02

    odometry: Odometry = rig.odometry.wait(moving, "measured twist")
    assert odometry.twist.twist.linear.x == pytest.approx(0.45, abs=0.02)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert odometry.pose == Odometry().pose, "no pose unless it is asked for"
    assert odometry.twist.covariance[0] > 0.0

    # Stamped twists: old ones are dropped, and a stamp of zero means now.
    rig.peer.silence(topics.WMX_CMD_VEL)
    clock = rig.peer.node.get_clock()
    rig.peer.repeat(topics.WMX_CMD_VEL_STAMPED, lambda: stamped(0.9, clock.now().to_msg()), 20.0)
    rig.wait_wheels(0.9 / RADIUS_M, 0.9 / RADIUS_M)
    rig.echo.wait(lambda m: m == twist(0.9), "the echo")
    rig.peer.repeat(topics.WMX_CMD_VEL_STAMPED, lambda: stamped(0.9, Time(sec=1)), 20.0)
    rig.wait_rest()
    node.wait_output("/diff_drive_controller/cmd_vel left out: it is ")
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

    node = rig.start_node(*STREAM, "-p", f"dec_time:={SLOW_RAMP_S}", "-p", "end_timeout_s:=30.0")
    rig.stays_at_rest()  # the stream of twists began before the node
    rig.set_out(0.5)
    rig.engine.kill()
    node.wait_output("waiting for the motion engine")
    rig.drive(0.0)
    rig.start_engine()
    rig.wait_ready()
    rig.set_out(0.5)

    node.signal(signal.SIGTERM)
    assert braking_s(rig.wait_status, 0, 0.5 / RADIUS_M) == pytest.approx(SLOW_RAMP_S, rel=0.02)
    assert node.wait() == 0
    rig.wait_status(lambda s: not s.servo_on.any(), "servos off")
    assert rig.engine.device.read_status()[1].communicating, "the bus belongs to all"


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
    rig.wait_rest()
    wait_for(lambda: abs(poses[-1].twist.twist.angular.z) < 1e-6, "odometry at rest")
    pose = poses[-1].pose.pose
    assert poses[-1].pose.covariance[35] > 0.0
    transform = transforms.wait(
        lambda m: abs(m.transforms[0].transform.translation.x - pose.position.x) < 1e-6, "the transform at rest"
    ).transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "base_link")
