"""Each invariant can fail: the violation is made directly, on a minimal fake world."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from std_msgs.msg import Bool

from custom_msgs.msg import MissionStatus, SafetyStatus, UICommand, VelocityLimit
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.robot import load_robot
from robot_stack.ros.serialization import serialize_message
from robot_stack.supervisor.lifecycle import State
from sim.scheduler.observers import LifeChange
from sim.stack.faults import INJECTED
from sim.stack.invariants import Invariants

_STEP_S = 0.01
_TIMED = (
    topics.JOINT_STATES,
    topics.LIDAR_POINTS,
    topics.OVERHEAD_LIDAR_POINTS,
    topics.OBSTACLES,
    topics.CURRENT_POSE,
    topics.IMU,
    topics.BATTERY_STATE,
    topics.EHMI_STATUS,
    topics.ROBOT_STATUS,
    topics.COMPUTER_TEMPERATURE,
)


class Scene:
    """A fake stack with only the parts that the invariants read. All messages arrive unless listed in ``missing``."""

    def __init__(self) -> None:
        pose = SimpleNamespace(x=0.0, y=0.0, yaw=0.0)
        truth = SimpleNamespace(pose=lambda: pose, linear_mps=(0.0, 0.0, 0.0))
        self.physics = SimpleNamespace(
            data=SimpleNamespace(qvel=np.zeros(14), qpos=np.array([0, 0, 0, 1.0, 0, 0, 0])),
            attached=False,
            touched={},
            drives=SimpleNamespace(alarm_codes=np.zeros(8), edge_pressed=False),
            truth=lambda: truth,
        )
        self.sim = SimpleNamespace(world=self.physics, engine_stalled=False, battery=SimpleNamespace(charge=0.8))
        self.kernel = SimpleNamespace(celsius=50.0, cpu_percent=10.0, memory_percent=30.0)
        self.cable = SimpleNamespace(plugged=True)
        self.scheduler = SimpleNamespace(now_s=0.0)
        world = SimpleNamespace(
            sim=self.sim, faults=SimpleNamespace(active=()), node=SimpleNamespace(robot=load_robot()), after_block=[]
        )
        stack: Any = SimpleNamespace(
            scheduler=self.scheduler,
            world=world,
            faults=SimpleNamespace(active=lambda: [], is_active=lambda *_: False),
            cable=self.cable,
            computer=SimpleNamespace(kernel=self.kernel, disk=SimpleNamespace(full=False)),
            supervision=SimpleNamespace(state=lambda _: State.BACKOFF),
        )
        self.missing: set[str] = set()
        self.checks = Invariants(stack)
        self.life("safety_monitor", LifeChange.READY)
        self.checks.begin()
        self.safety()
        self.limit(1.5)

    @property
    def names(self) -> list[str]:
        return [item.name for item in self.checks.broken]

    def publish(self, row: Topic, node: str, message: Any) -> None:
        data = bytes(serialize_message(message))
        self.checks.on_publish(round(1e9 * self.scheduler.now_s), node, row.name, data)

    def safety(self, state: str = "NORMAL", *codes: str) -> None:
        self.publish(topics.SAFETY_STATUS, "safety_monitor", SafetyStatus(safety_state=state, active_faults=codes))

    def limit(self, speed_mps: float) -> None:
        self.limit_mps = speed_mps
        message = VelocityLimit(max_linear_velocity=speed_mps, max_angular_velocity=1.0)
        self.publish(topics.VELOCITY_LIMIT, "safety_monitor", message)

    def life(self, process: str, change: LifeChange) -> None:
        self.checks.on_life_change(round(1e9 * self.scheduler.now_s), process, change)

    def run(self, duration_s: float, speed_mps: float = 0.0) -> None:
        for step in range(round(duration_s / _STEP_S)):
            self.scheduler.now_s += _STEP_S
            self.physics.data.qvel[0] = speed_mps
            time_ns = round(1e9 * self.scheduler.now_s)
            for row in _TIMED:
                if row.name not in self.missing:
                    self.checks.on_deliver(time_ns, "safety_monitor", row.name, b"")
            if step % 10 == 0:
                self.limit(self.limit_mps)
            self.checks.look()


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_contact_is_an_error_and_pedestrian_walking_into_robot_is_a_remark(scene: Scene) -> None:
    scene.run(2.0)
    scene.physics.touched["person_anna"] = 2.0
    scene.run(0.1)
    assert scene.names == []
    assert len(scene.checks.remarks) == 1
    scene.physics.touched["wall"] = 2.1
    scene.run(0.1, speed_mps=0.5)
    assert scene.names == ["contact"]


def test_motion_in_an_emergency_stop(scene: Scene) -> None:
    scene.run(1.0, speed_mps=1.0)
    scene.publish(topics.EMERGENCY_STOP, "touch_ui", Bool(data=True))
    scene.safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    scene.limit(0.0)
    scene.run(0.8, speed_mps=1.0)
    assert "moves_while_stopped" not in scene.names  # braking is still permitted
    scene.run(1.0, speed_mps=0.2)
    assert "moves_while_stopped" in scene.names


@pytest.mark.parametrize("asked", ["", "command", "call"])
def test_motion_after_a_release_needs_a_request(scene: Scene, asked: str) -> None:
    scene.safety("EMERGENCY_STOP", "TILT")
    scene.limit(0.0)
    scene.run(1.0)
    scene.safety()
    scene.limit(1.0)
    scene.publish(topics.GOAL_POSE, "mission_manager", PoseStamped())  # a node's own goal is no request
    if asked == "call":
        scene.checks.note_request()
    elif asked:
        command = UICommand(command_type=UICommand.RESUME)
        scene.publish(topics.UI_COMMAND, "touch_ui", command)
    scene.run(0.5, speed_mps=0.3)
    assert scene.names == ([] if asked else ["moves_unasked"])


def test_a_robot_that_does_not_follow_its_limit(scene: Scene) -> None:
    scene.run(2.0, speed_mps=1.4)
    assert scene.names == []
    scene.limit(0.5)
    scene.run(1.0, speed_mps=1.4)
    assert scene.names == []
    scene.run(3.0, speed_mps=1.4)
    assert "too_fast" in scene.names


@pytest.mark.parametrize(
    ("code", "break_it"),
    [
        ("JOINT_STATES_TIMEOUT", lambda scene: scene.missing.add("/joint_states")),
        ("LIDAR_TIMEOUT", lambda scene: scene.missing.add("/sensors/overhead_lidar/points")),
        ("OBSTACLES_TIMEOUT", lambda scene: scene.missing.add("/perception/obstacles")),
        ("LOCALIZATION_LOST", lambda scene: scene.missing.add("/current_pose")),
        ("IMU_TIMEOUT", lambda scene: scene.missing.add("/sensors/imu")),
        ("ESTOP_PRESSED", lambda scene: scene.publish(topics.EMERGENCY_STOP, "touch_ui", Bool(data=True))),
        ("DRIVE_FAULT", lambda scene: scene.physics.drives.alarm_codes.fill(1)),
        ("DRIVE_FAULT", lambda scene: setattr(scene.sim, "engine_stalled", True)),
        ("CONTACT", lambda scene: setattr(scene.physics.drives, "edge_pressed", True)),
        ("TILT", lambda scene: scene.physics.data.qpos.__setitem__(slice(3, 5), (0.98, 0.2))),
        ("BATTERY_LOW", lambda scene: setattr(scene.sim.battery, "charge", 0.2)),
        ("BATTERY_CRITICAL", lambda scene: setattr(scene.sim.battery, "charge", 0.1)),
        ("OVERHEAT", lambda scene: setattr(scene.kernel, "celsius", 95.0)),
        ("CPU_HIGH", lambda scene: setattr(scene.kernel, "cpu_percent", 99.0)),
        ("MEMORY_HIGH", lambda scene: setattr(scene.kernel, "memory_percent", 99.0)),
        ("EHMI_LINK_LOST", lambda scene: setattr(scene.cable, "plugged", False)),
        ("NODE_DEAD", lambda scene: scene.life("ndt_localization", LifeChange.KILLED)),
    ],
)
def test_a_row_that_is_not_raised(scene: Scene, code: str, break_it: Callable[[Scene], Any]) -> None:
    scene.run(3.0)
    assert scene.names == []
    break_it(scene)
    scene.run(15.0)
    assert ("row_not_raised", code) in [(item.name, item.text.split(":")[0]) for item in scene.checks.broken]


def test_a_row_without_its_action(scene: Scene) -> None:
    scene.run(21.0)  # beyond the start-up grace
    scene.safety("DEGRADED", "LIDAR_TIMEOUT", "IMU_TIMEOUT", "TILT")
    scene.run(0.5)
    assert sorted(item.text.split()[0] for item in scene.checks.broken) == ["IMU_TIMEOUT", "LIDAR_TIMEOUT", "TILT"]
    assert set(scene.names) == {"action_missing"}


def test_a_chair_that_is_forgotten(scene: Scene) -> None:
    scene.publish(topics.PASSENGER_ATTACHED, "docking_controller", Bool(data=False))
    assert scene.names == []
    scene.physics.attached = True
    scene.publish(topics.PASSENGER_ATTACHED, "docking_controller", Bool(data=False))
    assert scene.names == ["passenger_forgotten"]


@pytest.mark.parametrize(
    ("after", "name"),
    [
        (MissionStatus(state="IDLE"), "mission_lost"),
        (MissionStatus(state="RUNNING", mission_id="tour"), "mission_goes_on_unasked"),
        (MissionStatus(state="PAUSED", mission_id="tour"), None),
    ],
)
def test_a_mission_over_a_restart(scene: Scene, after: MissionStatus, name: str | None) -> None:
    scene.publish(topics.MISSION_STATUS, "mission_manager", MissionStatus(state="RUNNING", mission_id="tour"))
    scene.life("mission_manager", LifeChange.KILLED)
    scene.life("mission_manager", LifeChange.STARTED)
    scene.publish(topics.MISSION_STATUS, "mission_manager", after)
    assert scene.names == ([] if name is None else [name])


def test_a_node_that_fails_or_does_not_come_back(scene: Scene) -> None:
    scene.checks.on_exception(0, "costmap_server", f"Traceback\n{INJECTED}: asked for")
    assert scene.names == []
    scene.checks.on_exception(0, "costmap_server", "Traceback\nKeyError: 'a'")
    scene.life("touch_ui", LifeChange.KILLED)
    scene.run(41.0)
    assert scene.names == ["node_failed", "node_not_restarted"]


def test_messages_that_are_not_as_their_rows(scene: Scene) -> None:
    scene.publish(topics.CMD_VEL, "touch_ui", Twist())
    assert scene.names == ["contract_publisher"]
    bad = TwistStamped()
    bad.twist.linear.x = math.nan
    scene.publish(topics.CMD_VEL_LIMITED, "swerve_controller", bad)
    assert scene.names[1:] == ["contract_finite"]
    for _ in range(70):
        scene.publish(topics.CMD_VEL, "navigation_controller", Twist())
    assert scene.names[2:] == ["contract_rate"]
    scene.checks.on_publish(0, "touch_ui", "/private", b"")
    assert scene.names[3:] == ["contract_topic"]
