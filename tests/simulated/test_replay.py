"""Recorded rides replayed with the present code and configuration: a change of behaviour is a difference.

The rides of tests/rides/ were recorded with these commands, and thinned by ``robot-stack replay FOLDER --node NAME ...
--thin FILE``; --until cuts them. A ride is recorded again if a change of behaviour is intended.

goal_ahead.mcap: ``robot-stack simulate goal_ahead --light --record FOLDER``
goal_and_button.mcap: ``robot-stack simulate goal_and_button --world flat --light --record FOLDER``
yard_costmap.mcap: as goal_ahead.mcap, ``--until 5.5``
first_leg.mcap: real processes, ``robot-stack up --speed 0.25`` at the start of the short demonstration, ``robot-stack
record``, ``robot-stack mission start short_transport``; ``--until 13.5``: afterwards the world stood still for a moment
(docs/recording.md, Replay)
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import topics
from robot_stack.contract.processes import PROCESSES
from robot_stack.core.config import config_dir
from robot_stack.recording.provenance import configuration
from robot_stack.recording.writer import BagWriter, topic_info
from robot_stack.ros.serialization import serialize_message
from sim.replay.main import main, replay_recording
from sim.replay.nodes import NOT_REPLAYED, REPLAYED, rows_of
from sim.replay.recorded import Recorded, read_recording
from sim.replay.replay import NodeResult, life_of
from sim.scheduler.observers import Recording

RIDES = Path(__file__).parents[1] / "rides"
NODES = {
    "goal_ahead": ("swerve_controller", "navigation_controller"),
    "goal_and_button": ("swerve_controller", "navigation_controller", "costmap_server"),
    "yard_costmap": ("costmap_server",),
    "first_leg": ("swerve_controller",),
}
PAIRS = [(ride, node) for ride, nodes in NODES.items() for node in nodes]


def ride(name: str, *nodes: str) -> Recorded:
    return read_recording(RIDES / f"{name}.mcap", [row for node in nodes for row in rows_of(node)])


def replayed(name: str, node: str, *settings: str) -> NodeResult:
    return replay_recording(ride(name, node), [node], settings)[0]


def different(result: NodeResult) -> set[str]:
    return {row.topic for row in result.rows if row.comparison is not None and not row.comparison.equal}


@pytest.mark.parametrize(("name", "node"), PAIRS)
def test_a_ride_is_reproduced(name: str, node: str) -> None:
    result = replayed(name, node)
    assert not result.not_replayed
    assert result.compared
    assert result.equal, [row for row in result.rows if row.topic in different(result)]


@pytest.mark.parametrize(
    ("name", "setting", "topic"),
    [
        ("goal_ahead", "navigation_controller.tracking.position_gain_per_s=4.0", topics.CMD_VEL),
        ("goal_and_button", "navigation_controller.limits.cruise_speed_mps=1.4", topics.CMD_VEL),
        ("first_leg", "swerve_controller.module.steering_share=0.6", topics.WHEEL_COMMANDS),
        ("yard_costmap", "costmap_server.inflation.scaling_per_m=3.1", topics.LOCAL_COSTMAP),
    ],
)
def test_a_changed_parameter_is_a_difference(name: str, setting: str, topic: topics.Topic) -> None:
    result = replayed(name, setting.partition(".")[0], setting)
    assert topic.name in different(result)
    assert not result.equal


@pytest.fixture
def weaker_stop(tmp_path: Path) -> Path:
    """A configuration whose emergency stop decelerates less."""
    folder = tmp_path / "config"
    shutil.copytree(config_dir(), folder)
    file, limit = folder / "robot.yaml", "emergency_deceleration_mps2: 2.0"
    text = file.read_text()
    assert limit in text
    file.write_text(text.replace(limit, "emergency_deceleration_mps2: 1.5"))
    return folder


def test_a_changed_limit_of_the_robot_is_a_difference(weaker_stop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(weaker_stop))
    assert topics.CMD_VEL_LIMITED.name in different(replayed("goal_and_button", "swerve_controller"))


def test_the_configuration_stored_with_a_recording_applies(weaker_stop: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded, node = ride("goal_and_button", "swerve_controller"), "swerve_controller"
    with monkeypatch.context() as changed:
        changed.setenv("ROBOT_STACK_CONFIG", str(weaker_stop))
        recorded.configuration = configuration()
    assert topics.CMD_VEL_LIMITED.name in different(replay_recording(recorded, [node], present=False)[0])
    assert replay_recording(recorded, [node])[0].equal


def test_a_thinned_input_is_named_and_not_passed() -> None:
    result = replayed("goal_ahead", "perception_pipeline")
    assert topics.LIDAR_HALF_SWEEP.name in result.not_replayed
    assert not result.compared


def test_outputs_that_depend_on_an_unrecorded_start_are_not_compared() -> None:
    recorded = ride("first_leg", "swerve_controller")
    life = life_of("swerve_controller", recorded)
    assert life is not None
    assert not life.recorded_start
    rows = {row.topic: row for row in replayed("first_leg", "swerve_controller").rows}
    assert rows[topics.ODOM.name].comparison is None
    assert rows[topics.ODOM.name].skipped


def test_a_missing_input_is_a_difference() -> None:
    """The joint states end in the middle of the ride."""
    recorded = ride("first_leg", "swerve_controller")
    joints = recorded.messages[topics.JOINT_STATES.name]
    del joints[len(joints) // 2 :]
    result = replay_recording(recorded, ["swerve_controller"])[0]
    assert topics.WHEEL_COMMANDS.name in different(result)


def test_every_node_is_replayed_or_has_a_reason() -> None:
    assert not set(REPLAYED) & set(NOT_REPLAYED)
    names = {process.name for process in PROCESSES}
    assert names >= set(REPLAYED) | set(NOT_REPLAYED)
    publishers = {node for row in topics.TOPICS for node in row.publishers}
    assert publishers >= set(REPLAYED)


def test_the_command_names_each_node_and_exits_by_the_result(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, thin = str(RIDES / "first_leg.mcap"), tmp_path / "thin.mcap"
    assert main([file, "--thin", str(thin)]) == 0
    shown = capsys.readouterr().out
    assert "swerve_controller: reproduced" in shown
    assert "costmap_server: not replayed: /perception/obstacles is not recorded" in shown
    assert "configuration: the present one" in shown
    change = "swerve_controller.module.steering_share=0.6"
    assert main([str(thin), "--node", "swerve_controller", "--set", change]) == 1
    assert "DIFFERENT" in capsys.readouterr().out


def test_wrong_use_is_refused_in_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    text, empty = tmp_path / "notes.mcap", tmp_path / "empty"
    text.write_text("no recording")
    BagWriter(empty, [topic_info(topics.EMERGENCY_STOP)], Recording.FORMAT).close()
    alone = tmp_path / "alone"
    bag = BagWriter(alone, [topic_info(topics.EMERGENCY_STOP)], Recording.FORMAT)
    bag.write(topics.EMERGENCY_STOP.name, 1, 1, serialize_message(Bool()))
    bag.close()
    for path, problem in (
        (text, "does not begin as an MCAP file"),
        (tmp_path / "none.mcap", "cannot be read"),
        (empty, "contains no message of the contract"),
        (alone, "no node could be compared"),
    ):
        assert main([str(path)]) == 2
        assert problem in capsys.readouterr().err
    with pytest.raises(SystemExit) as refused:
        main([str(RIDES / "first_leg.mcap"), "--node", "swerve"])
    assert refused.value.code == 2
    assert "swerve_controller" in capsys.readouterr().err
