"""The same seed gives the same run in every process; recordings; stack nodes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode
from sim.scheduler import Digest, Recording, Scheduler
from sim.scheduler.rules import Lose

_NAMES = ("swerve_hardware_interface", "swerve_controller", "docking_controller", "mission_manager", "touch_ui")


class Node(StackNode):
    """Publishes the topics of its rows at 20 Hz and subscribes to the rest."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._sum = 0.0
        self._worker = self.worker("planner", world_waits=True)
        self.set_health(True, "ready")
        if name == "swerve_hardware_interface":
            self.subscribe(topics.WHEEL_COMMANDS, lambda _: self._joints.publish(self._joint_states()))
            self._joints = self.advertise(topics.JOINT_STATES)
            self.every(50.0, lambda: self._joints.publish(self._joint_states()))
        if name == "swerve_controller":
            from custom_msgs.msg import SwerveModuleCommandArray

            commands = self.advertise(topics.WHEEL_COMMANDS)
            self.joints = self.subscribe(topics.JOINT_STATES, self._on_joints)
            self.every(20.0, lambda: commands.publish(SwerveModuleCommandArray()))
        if name == "touch_ui":
            source = self.emergency_stop_source()
            self.every(0.5, lambda: source.publish(True))

    def _joint_states(self) -> Any:
        from sensor_msgs.msg import JointState

        message = JointState(position=[self._sum])
        message.header.stamp = self.stamp()
        return message

    def _on_joints(self, message: Any) -> None:
        self._worker.submit(lambda: message.header.stamp.nanosec * 1e-9, self._add)

    def _add(self, value: float) -> None:
        self._sum += value


def ride(scheduler: Scheduler, seconds: float) -> None:
    for name in _NAMES:
        scheduler.spawn(name, lambda name=name: Node(name))
    scheduler.at(2_000_000_000, scheduler.processes["swerve_controller"].restart)
    scheduler.at(3_000_000_000, scheduler.processes["touch_ui"].hang, 0.4)
    scheduler.network.add_rule(Lose(name="lost", topic="/joint_states", probability=0.05))
    scheduler.run(seconds)


def digest(seed: int, seconds: float = 6.0, *, parallel: bool = False) -> tuple[str, int]:
    with Scheduler(seed, parallel=parallel) as scheduler:
        seen = Digest()
        scheduler.add_observer(seen)
        ride(scheduler, seconds)
        assert scheduler.failures == []
    return seen.hexdigest(), seen.messages


def test_a_seed_is_a_run() -> None:
    first, messages = digest(1)
    assert messages > 500
    assert digest(1, parallel=True) == (first, messages)
    assert digest(2)[0] != first


def test_the_digest_is_that_of_other_processes() -> None:
    code = f"import sys; sys.path.insert(0, '.'); from {__name__} import digest; print(digest(7)[0])"
    found = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for hash_seed in ("1", "2")
    }
    assert found == {digest(7)[0]}


def test_a_stack_node_runs_as_it_is() -> None:
    with Scheduler(1) as scheduler:
        ride(scheduler, 6.0)
        process = scheduler.processes["swerve_controller"]
        (node,) = process.nodes
        assert isinstance(node, Node)
        assert node.joints.fresh()
        assert node.emergency_stop
        assert node.report.ok
        touch = scheduler.processes["touch_ui"].life
        assert touch is not None
        assert "held up" in touch.ports[0].report_values()


def test_a_run_is_recorded_as_by_the_recorder(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    rows = [topics.JOINT_STATES, topics.WHEEL_COMMANDS, topics.HEARTBEAT]
    with Scheduler(1) as scheduler:
        recording = Recording(tmp_path / "ride", rows, scheduler.clock_start_ns)
        scheduler.add_observer(recording)
        ride(scheduler, 3.0)
        recording.close()
        begin_s, end_s = 1e-9 * scheduler.clock_start_ns, 1e-9 * scheduler.clock_start_ns + 3.0
    with open(tmp_path / "ride" / "ride_0.mcap", "rb") as file:
        seen = [(channel.topic, 1e-9 * message.log_time) for _, channel, message in make_reader(file).iter_messages()]
    assert {topic for topic, _ in seen} == {row.name for row in rows}
    assert all(begin_s <= at_s <= end_s for _, at_s in seen)
    assert (tmp_path / "ride" / "metadata.yaml").exists()


def test_a_scheduler_without_its_folder_refuses() -> None:
    with pytest.raises(RuntimeError, match="with statement"):
        Scheduler(1).spawn("node", lambda: Node("node"))
