"""The whole stack on the simulation, with the operations and observations of tests."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import TwistStamped

from custom_msgs.msg import UICommand
from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, pose_from_transform, time_to_s
from robot_stack.supervisor import client
from robot_stack.supervisor.control import ask
from sim.settings import FEW_BEAMS, world_settings
from tests.support.peer import Peer
from tests.support.stick import Stick
from tests.support.waiting import DEADLINE_S, wait_for
from tf2_msgs.msg import TFMessage

# Most tests run in simulated time, in a world that waits for a stack that falls behind. A busy machine then pauses the
# world instead of looking like a silent sensor. The world makes up for no delay.
_PATIENT = ("sim_world.catch_up_s=0.005",)
# Upper limit of the speed, times real time: as fast as the machine can, because the world waits for its robot.
_SPEED = 2.0
# A world of even asphalt, which has no map.
FLAT = (*world_settings("flat"), *FEW_BEAMS)
# Slower than this counts as standstill: the physics never rests at exactly 0.
STANDSTILL_MPS = 0.01
STANDSTILL_RADPS = 0.02


def true_pose(bodies: TFMessage, name: str) -> Pose2:
    """The true pose of a body in /sim/bodies."""
    return pose_from_transform(next(item.transform for item in bodies.transforms if item.child_frame_id == name))


class StackUnderTest:
    """Started by the supervisor like any other stack; a peer outside the contract subscribes and injects faults."""

    def __init__(self, logs: Path, *settings: str, profile: str = "sim", fleet: str | None = None) -> None:
        """fleet: URL of a broker."""
        self.logs = logs
        launch = client.Launch(profile, (*settings, *_PATIENT), speed=_SPEED, log_dir=logs, fleet=fleet)
        try:
            client.start(launch, 90.0)
        except client.StartError:
            client.stop()
            raise
        self.peer = Peer("scenario_peer")
        self.stick = Stick()
        self.truth = self.peer.listen(topics.SIM_GROUND_TRUTH)
        self.safety = self.peer.listen(topics.SAFETY_STATUS)
        self.limit = self.peer.listen(topics.VELOCITY_LIMIT)
        self.mission = self.peer.listen(topics.MISSION_STATUS)
        self.commands = self.peer.listen(topics.WHEEL_COMMANDS)
        self.odom = self.peer.listen(topics.ODOM)
        for topic in (topics.EMERGENCY_STOP, topics.TELEOP_CMD_VEL, topics.UI_COMMAND, topics.GOAL_POSE):
            self.peer.publisher(topic)
        self.truth.wait(lambda _: True, "ground truth")
        self.safety.wait(lambda _: True, "a safety status")
        self.limit.wait(lambda _: True, "a speed limit")
        self.peer.wait_matched(topics.TELEOP_CMD_VEL)
        self.peer.wait_matched(topics.UI_COMMAND)
        self.peer.stop_source()
        self.peer.wait_matched(topics.EMERGENCY_STOP_SOURCES)

    def close(self) -> None:
        self.stick.close()
        self.peer.close()
        client.stop()

    # --- observations -------------------------------------------------------------------------------------------------

    @property
    def speed_mps(self) -> float:
        """True speed over ground."""
        linear = self.truth.last.twist.twist.linear
        return math.hypot(linear.x, linear.y)

    @property
    def stands(self) -> bool:
        return self.speed_mps < STANDSTILL_MPS and abs(self.truth.last.twist.twist.angular.z) < STANDSTILL_RADPS

    def at(self) -> Pose2:
        """The true pose of the robot."""
        return pose_from_msg(self.truth.last.pose.pose)

    def now_s(self) -> float:
        """The simulated time."""
        return time_to_s(self.truth.last.header.stamp)

    def wait_within(self, limit_s: float, condition: Callable[[], Any], what: str) -> None:
        """Waits for the condition within a limit of simulated time, however slow the machine simulates."""
        end_s = self.now_s() + limit_s

        def ended() -> str:
            in_vain = self.now_s() > end_s  # read before the condition, which may become true at the last moment
            return "met" if condition() else "in vain" if in_vain else ""

        assert wait_for(ended, what) == "met", f"timed out after {limit_s} s of the world waiting for: {what}"

    def wait_stands(self, limit_s: float = DEADLINE_S) -> None:
        self.wait_within(limit_s, lambda: self.stands, "the robot stands")

    def wait_safety(self, state: str, fault: str = "", deadline_s: float = DEADLINE_S) -> Any:
        try:
            return self.safety.wait(
                lambda message: message.safety_state == state and (not fault or fault in message.active_faults),
                f"safety state {state} {fault}",
                deadline_s,
            )
        except AssertionError as error:
            raise AssertionError(f"{error}; it is {self._safety_text()}") from None

    def _safety_text(self) -> str:
        return f"{self.safety.last.safety_state} {list(self.safety.last.active_faults)}"

    def process(self, name: str) -> dict[str, Any]:
        return next(item for item in ask("status")["processes"] if item["name"] == name)

    def log(self, name: str) -> str:
        return "".join(path.read_text(errors="replace") for path in sorted(self.logs.glob(f"*/{name}.log")))

    # --- operations ---------------------------------------------------------------------------------------------------

    def drive(self, vx_mps: float, vy_mps: float = 0.0, omega_radps: float = 0.0) -> None:
        """Teleoperates at 20 Hz until ``let_go``. The first commands are zero, as those of a joystick."""
        message = TwistStamped()
        message.twist.linear.x, message.twist.linear.y, message.twist.angular.z = vx_mps, vy_mps, omega_radps
        at_rest = [] if self.stick.idle_s == 0.0 else [TwistStamped() for _ in range(3)]
        self.stick.hold(lambda: self.peer.publish(topics.TELEOP_CMD_VEL, at_rest.pop() if at_rest else message))

    def drive_at(self, speed_mps: float) -> None:
        """Drives ahead and waits until the robot has nearly that speed."""
        self.drive(speed_mps)
        try:
            wait_for(lambda: self.speed_mps > 0.9 * speed_mps, f"the robot drives at {speed_mps} m/s")
        except AssertionError as error:
            limit, drive = self.limit.last, self.process("swerve_controller")
            reported = f"{self._safety_text()}, limit {limit.max_linear_velocity} {limit.reason}"
            near = f"nearest obstacle {self.safety.last.min_obstacle_distance:.2f} m, the robot at {self.at()}"
            raise AssertionError(f"{error}; it is {reported}; {near}; swerve_controller: {drive}") from None

    def let_go(self) -> None:
        """Returns when the drive considers the stick released: after a stop, only a new command may drive again."""
        self.stick.let_go()
        silent_s = 2.0 * topics.TELEOP_CMD_VEL.stale_limit_s
        wait_for(lambda: self.stick.idle_s > silent_s, "the drive takes the stick for let go")

    def inject(self, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0) -> str:
        request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s)
        answer = self.peer.call(services.INJECT_FAULT, request)
        assert answer.success, answer.message
        return str(answer.message)

    def estop(self, pressed: bool) -> None:
        self.peer.stop_source().publish(pressed)

    def reset(self) -> Any:
        return self.peer.call(services.SAFETY_RESET)

    def release(self, deadline_s: float = DEADLINE_S) -> None:
        """Releases the stop and repeats the reset until the monitor accepts it."""
        self.estop(False)
        last = [""]

        def granted() -> bool:
            answer = self.reset()
            last[0] = answer.message
            if not answer.success:
                self.estop(False)
                time.sleep(0.2)
            return bool(answer.success)

        try:
            wait_for(granted, "the release", deadline_s)
        except AssertionError as error:
            raise AssertionError(f"{error}; last answer: {last[0]}") from None

    def command(self, command_type: str, mission_id: str = "") -> None:
        self.peer.publish(topics.UI_COMMAND, UICommand(command_type=command_type, mission_id=mission_id))

    def kill(self, name: str, number: signal.Signals = signal.SIGKILL) -> int:
        """Sends a signal to a process of this stack and returns its pid."""
        pid = int(self.process(name)["pid"])
        os.kill(pid, number)
        return pid

    def wait_restarted(self, name: str, old_pid: int, deadline_s: float = DEADLINE_S) -> None:
        def again() -> bool:
            entry = self.process(name)
            return entry["state"] == "ready" and entry["pid"] != old_pid

        wait_for(again, f"{name} runs again", deadline_s, poll_s=0.1)

    def make_ready(self) -> None:
        """Restores a standing robot without faults in state NORMAL, whatever the previous test did."""
        self.let_go()
        self.inject("clear")
        self.wait_stands()
        wait_for(lambda: ask("status")["ready"], "every process ready", 40.0, poll_s=0.1)
        if self.mission.last is not None and self.mission.last.state in ("RUNNING", "WAITING", "PAUSED"):
            self.command("ABORT")
            self.mission.wait(lambda message: message.state == "ABORTED", "the mission aborted")
        if self.safety.last.safety_state == "EMERGENCY_STOP":
            self.release()
        self.wait_safety("NORMAL", deadline_s=60.0)
