"""The command line with fake and real nodes."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from custom_msgs.msg import DockingStatus, MissionStatus, UICommand
from robot_stack.contract import topics
from robot_stack.core.config import config_dir
from robot_stack.ros.interfaces import qos_profile
from robot_stack.system_monitor.nodes.topic_meter import Meter
from tests.support.fake_safety import FakeSafety
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]


def cli(*arguments: str, timeout_s: float = 100.0, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "robot_stack.cli", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        env={**os.environ, **environment},
        check=False,
    )


# --- without ROS ------------------------------------------------------------------------------------------------------


def test_help_names_every_verb_and_imports_no_ros() -> None:
    code = "import sys; from robot_stack.cli.app import app; print(sorted(sys.modules))"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True).stdout
    for heavy in ("'rclpy'", "'numpy'", "'pydantic'", "'custom_msgs'"):
        assert heavy not in modules
    shown = cli("--help").stdout
    for verb in ("up", "down", "status", "restart", "run", "mission", "estop", "reset", "topics", "record"):
        assert f" {verb} " in shown
    for verb in ("doctor", "bench", "simulate", "docking", "view", "film"):
        assert f" {verb} " in shown


@pytest.mark.parametrize("verb", ["status", "restart x"])
def test_without_a_stack(ros_domain: int, verb: str) -> None:
    done = cli(*verb.split())
    assert done.returncode == 1
    assert done.stderr == f"error: no stack is running in ROS domain {ros_domain}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("up --profile nothing", "there is no profile 'nothing'; known profiles: diff_drive, diff_drive_real, general"),
        ("up --only nobody", "--only: nobody: not a built process of this profile"),
        ("up --set swerve_controller", "must read node.parameter=value"),
        ("up --profile robot --speed 2", "no simulated world"),
        ("run nobody", "nobody is not a node of this stack; nodes that can run:"),
    ],
)
def test_wrong_use_is_one_clear_line(ros_domain: int, arguments: str, message: str) -> None:
    done = cli(*arguments.split())
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_missions_are_listed() -> None:
    done = cli("mission", "list")
    assert done.returncode == 0
    assert "yard_tour: Yard tour, " in done.stdout


@pytest.fixture
def own_config(tmp_path: Path) -> Path:
    """A copy of the configuration that a test may change."""
    return Path(shutil.copytree(config_dir(), tmp_path / "config"))


def test_malformed_mission_is_named(own_config: Path) -> None:
    (own_config / "missions" / "short_hop.yaml").write_text("id: short_hop\nwaypoints: 5\n")
    done = cli("mission", "list", ROBOT_STACK_CONFIG=str(own_config))
    assert done.returncode == 1
    assert "short_hop: " in done.stdout
    assert "waypoints" in done.stdout
    assert "yard_tour: Yard tour" in done.stdout


class TestDoctor:
    def findings(self, **environment: str) -> tuple[int, dict[str, list[dict[str, str]]]]:
        done = cli("doctor", "--json", **environment)
        found: dict[str, list[dict[str, str]]] = {}
        for entry in json.loads(done.stdout):
            found.setdefault(entry["check"], []).append(entry)
        return done.returncode, found

    def test_this_machine_can_run_the_stack(self, ros_domain: int) -> None:
        code, found = self.findings()
        bad = [entry for entries in found.values() for entry in entries if entry["level"] == "bad"]
        assert bad == []
        assert code == 0
        assert {"python", "cores", "shared memory", "interfaces", "configuration", "network", "clock"} <= set(found)

    def test_all_that_is_wrong_is_named_with_advice(self, own_config: Path) -> None:
        wrong = (
            ("robot.yaml", "wheel_radius_m: -1", "wheel_radius_m"),
            ("swerve_controller.yaml", "surprise: 1", "surprise"),
            ("profiles/sim.yaml", "machine: boat", "machine"),
            ("worlds/flat.yaml", "[", "not valid YAML"),
        )
        for file, text, _ in wrong:
            (own_config / file).write_text(text)
        code, found = self.findings(
            ROBOT_STACK_CONFIG=str(own_config), ROS_DOMAIN_ID="300", ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET"
        )
        assert code == 1
        worse = [entry for entries in found.values() for entry in entries if entry["level"] != "ok"]
        assert all(entry["advice"] for entry in worse)
        assert found["network"][0]["level"] == "note"
        assert "0..232" in found["ROS domain"][0]["what"]
        problems = " ".join(entry["what"] for entry in found["configuration"])
        assert [text for file, _, field in wrong for text in (file, field) if text not in problems] == []


def test_benchmarks_are_listed_and_unknown_ones_refused() -> None:
    listed = cli("bench").stdout
    assert [name for name in ("stop:", "rates:", "startup:") if name not in listed] == []
    done = cli("bench", "nothing")
    assert done.returncode == 1
    assert "there is no benchmark 'nothing'; known: " in done.stderr


def test_simulate_without_a_scenario_is_refused() -> None:
    done = cli("simulate", "/nowhere.yaml")
    assert done.returncode == 2
    assert "nowhere.yaml" in done.stderr


# --- emergency stop and reset -----------------------------------------------------------------------------------------


@pytest.fixture
def safety(peer: Peer) -> FakeSafety:
    return FakeSafety(peer)


def test_estop_is_confirmed(safety: FakeSafety) -> None:
    done = cli("estop")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("emergency stop, confirmed after ")
    assert safety.active
    assert True in safety.requests


def test_unconfirmed_estop_is_sent_and_returns_error(safety: FakeSafety) -> None:
    safety.obeys = False
    done = cli("estop", "--timeout", "2")
    assert done.returncode == 1
    assert "did not confirm it: use the button" in done.stderr
    assert True in safety.requests


def test_estop_without_anybody(ros_domain: int) -> None:
    assert cli("estop", "--timeout", "1").returncode == 1


def test_reset_sends_false_then_releases_emergency_stop(safety: FakeSafety) -> None:
    safety.active = True
    done = cli("reset")
    assert done.returncode == 0, done.stderr
    assert "released: ESTOP_PRESSED" in done.stdout
    assert safety.requests == [False]
    assert not safety.active


def test_reset_is_patient_with_a_monitor_that_must_see_the_release_first(safety: FakeSafety) -> None:
    safety.refusals = ["released a moment ago"]
    assert cli("reset").returncode == 0


def test_refused_reset_shows_the_reason_and_how_to_clear_a_source_that_is_gone(safety: FakeSafety) -> None:
    safety.active = True
    safety.refusals = ["refused: the robot moves at 0.40 m/s"] * 100
    done = cli("reset")
    assert done.returncode == 1
    assert done.stderr.startswith("error: refused: the robot moves at 0.40 m/s; ")
    assert "robot-stack reset --clear NAME" in done.stderr
    assert safety.active


def test_sources_that_are_gone_are_cleared_by_name_before_the_reset(safety: FakeSafety) -> None:
    safety.active = True
    done = cli("reset", "--clear", "touch_ui", "--clear", "unknown")
    assert done.returncode == 0, done.stderr
    assert safety.cleared == ["robot_stack_cli", "touch_ui", "unknown"]
    assert not safety.active


def test_a_source_that_cannot_be_cleared_ends_the_reset(safety: FakeSafety) -> None:
    safety.active, safety.uncleared = (
        True,
        "refused: touch_ui is running and reports that it is pressed: release it there",
    )
    done = cli("reset", "--clear", "touch_ui")
    assert done.returncode == 1
    assert "release it there" in done.stderr
    assert safety.active


def test_reset_without_anybody(ros_domain: int) -> None:
    done = cli("reset", "--timeout", "1")
    assert done.returncode == 1
    assert "is the stack running?" in done.stderr


# --- missions ---------------------------------------------------------------------------------------------------------


class FakeMissions:
    """A mission manager with one mission."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self.commands: list[tuple[str, str]] = []
        self.status = MissionStatus(state="IDLE", eta_s=float("nan"))
        peer.listen(topics.UI_COMMAND, self._on_command)
        self.publish()

    def publish(self) -> None:
        self._peer.publish(topics.MISSION_STATUS, self.status)

    def _on_command(self, message: UICommand) -> None:
        self.commands.append((message.command_type, message.mission_id))
        accepted = message.command_type != "START_MISSION" or message.mission_id == "yard_tour"
        self.status.last_command, self.status.last_command_accepted = message.command_type, accepted
        self.status.reason = "" if accepted else "there is no such mission"
        if accepted and message.command_type == "START_MISSION":
            self.status.state, self.status.mission_id, self.status.total_waypoints = "RUNNING", "yard_tour", 10
        self.publish()


@pytest.fixture
def missions(peer: Peer) -> FakeMissions:
    return FakeMissions(peer)


def test_mission_start(missions: FakeMissions) -> None:
    done = cli("mission", "start", "yard_tour")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "RUNNING, yard_tour 0/10 waypoints, 0%\n"
    assert missions.commands == [("START_MISSION", "yard_tour")]


def test_rejected_mission_start_reports_reason(missions: FakeMissions) -> None:
    done = cli("mission", "start", "nowhere")
    assert done.returncode == 1
    assert done.stderr == "error: START_MISSION was refused: there is no such mission\n"


@pytest.mark.parametrize("verb", ["pause", "resume", "abort"])
def test_mission_commands(missions: FakeMissions, verb: str) -> None:
    assert cli("mission", verb).returncode == 0
    assert missions.commands == [(verb.upper(), "")]


def test_mission_watch_once(missions: FakeMissions) -> None:
    missions.status.state, missions.status.mission_id, missions.status.eta_s = "RUNNING", "yard_tour", 12.0
    missions.status.current_waypoint, missions.status.progress = "lane", 0.5
    missions.status.waypoints_completed, missions.status.total_waypoints = 1, 10
    missions.publish()
    done = cli("mission", "watch", "--once")
    assert done.returncode == 0
    assert "RUNNING, yard_tour 1/10 waypoints, 50%, to lane, 12 s left" in done.stdout


def test_mission_without_a_manager(ros_domain: int) -> None:
    done = cli("mission", "pause", "--timeout", "1")
    assert done.returncode == 1
    assert "no mission manager answers: is the stack running?" in done.stderr


# --- docking ----------------------------------------------------------------------------------------------------------


def test_docking_status(peer: Peer) -> None:
    status = DockingStatus(state="SERVOING", position_error=0.1234, orientation_error=-0.01, visible_markers_count=4)
    peer.repeat(topics.DOCKING_STATUS, lambda: status, 10.0)
    done = cli("docking", "status", "--once")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "SERVOING, 123.4 mm, -0.57 deg, 4 markers, 0%\n"


def test_docking_status_prints_each_state_and_missing_messages(peer: Peer, start: Callable[..., Any]) -> None:
    status = DockingStatus(state="SEARCH", visible_markers_count=1)
    peer.repeat(topics.DOCKING_STATUS, lambda: status, 10.0)
    watching = start(command=[sys.executable, "-m", "robot_stack.cli", "docking", "status"])
    watching.wait_output("SEARCH, 0.0 mm, +0.00 deg, 1 marker, 0%")
    status.state, status.position_error = "FAILED", float("nan")
    watching.wait_output("FAILED, +0.00 deg, 1 marker")
    peer.silence(topics.DOCKING_STATUS)
    watching.wait_output("no /docking/status for")
    watching.signal(signal.SIGINT)
    assert watching.wait() == 0


def test_docking_without_a_stack(ros_domain: int) -> None:
    done = cli("docking", "status", "--timeout", "1")
    assert done.returncode == 1
    assert done.stderr == "error: no /docking/status: is the stack running?\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("markers --pdf /proc/boards.pdf", "/proc/boards.pdf cannot be written"),
        ("markers --pdf boards.pdf --dock nowhere", "there is no dock 'nowhere'; known docks: chair_1, charger"),
        ("markers --pdf boards.pdf --paper a9", "a9"),
        ("replay /nowhere --output /tmp", "/nowhere cannot be read"),
    ],
)
def test_wrong_use_of_docking(arguments: str, message: str) -> None:
    done = cli("docking", *arguments.split())
    assert done.returncode in (1, 2)
    assert message in done.stderr


def test_marker_boards_are_printed(tmp_path: Path) -> None:
    done = cli("docking", "markers", "--pdf", str(tmp_path / "boards.pdf"), "--dock", "chair_1")
    assert done.returncode == 0, done.stderr
    pdf = (tmp_path / "boards.pdf").read_bytes()
    assert pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page ") == 5
    assert pdf.count(b"/MediaBox [ 0 0 595.27559") == 5  # A4: 210 mm


# --- topics -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def drive_profile(tmp_path: Path) -> str:
    path = tmp_path / "drive.yaml"
    data = {
        "description": "the swerve controller alone",
        "machine": "robot",
        "use_sim_time": False,
        "speed": None,
        "ready_deadline_s": 10.0,
        "engine": None,
        "processes": ["swerve_controller"],
    }
    path.write_text(yaml.safe_dump(data))
    return str(path)


@pytest.fixture
def controller(ros_domain: int) -> Iterator[Peer]:
    """A peer with the name swerve_controller."""
    peer = Peer("swerve_controller")
    yield peer
    peer.close()


def measure(profile: str) -> tuple[int, dict[str, dict[str, Any]], list[str]]:
    done = cli("topics", "--profile", profile, "--json", "--window", "2")
    result = json.loads(done.stdout)
    return done.returncode, {entry["name"]: entry for entry in result["topics"]}, result["unknown"]


def test_topics_command_reports_missing_and_present_publishers(controller: Peer, drive_profile: str) -> None:
    controller.repeat(topics.ODOM, Odometry, 50.0)
    code, found, unknown = measure(drive_profile)
    assert code == 1
    assert unknown == []
    odom = found["/odom"]
    assert odom["publishers"] == ["swerve_controller"]
    # On a busy machine the rate is below the contract's.
    assert [problem for problem in odom["problems"] if "Hz instead of" not in problem] == []
    assert found["/swerve/wheel_commands"]["problems"] == ["not published by swerve_controller"]
    assert found["/sensors/imu"]["verdict"] == "not run"


def test_topics_names_strangers_wrong_types_wrong_qos_silence_and_unknown_topics(
    controller: Peer, peer: Peer, drive_profile: str
) -> None:
    controller.node.create_publisher(Odometry, topics.ODOM.name, 10)
    peer.publisher(topics.ODOM)
    controller.node.create_publisher(String, topics.WHEEL_COMMANDS.name, qos_profile(topics.WHEEL_COMMANDS.qos))
    controller.node.create_publisher(String, "/mine", 1)
    _, found, unknown = measure(drive_profile)
    assert "published by peer, which the contract does not name" in found["/odom"]["problems"]
    assert "swerve_controller publishes RELIABLE, VOLATILE" in found["/odom"]["problems"]
    assert "advertised, but nothing is sent" in found["/odom"]["problems"]
    assert "type std_msgs/msg/String in the graph" in found["/swerve/wheel_commands"]["problems"]
    assert unknown == ["/mine"]


def test_rates_are_those_of_simulated_time(ros_domain: int, peer: Peer) -> None:
    """At twice real time, 100 messages a second are 50 Hz."""
    ticks = itertools.count()

    def tick() -> Clock:
        nanoseconds = 100_000_000_000 + next(ticks) * 20_000_000
        return Clock(clock=Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9))

    peer.repeat(topics.CLOCK, tick, 100.0)
    peer.repeat(topics.ODOM, Odometry, 100.0)
    with Meter([topics.CLOCK, topics.ODOM]) as meter:
        wait_for(lambda: meter.run(0.1) or meter.seen()["/odom"].traffic.count, "odometry")
        meter.run(2.0)
        speed, rate_hz = meter.speed(), meter.seen()["/odom"].traffic.rate_hz
    # A busy machine ticks slower: both values fall, and their ratio stays.
    assert speed > 1.0
    assert rate_hz == pytest.approx(50.0, rel=0.1)


def test_topics_as_a_table(ros_domain: int, drive_profile: str) -> None:
    done = cli("topics", "--once", "--profile", drive_profile, "--window", "0.5")
    assert done.returncode == 1
    assert "not published by swerve_controller" in done.stdout
    assert "topics differ from the contract" in done.stdout


# --- programs ---------------------------------------------------------------------------------------------------------


def test_record_writes_until_interrupted(start: Callable[..., NodeProcess], peer: Peer, tmp_path: Path) -> None:
    peer.repeat(topics.ODOM, Odometry, 50.0)
    command = [sys.executable, "-m", "robot_stack.cli", "record", "--output", str(tmp_path), "--name", "ride"]
    recorder = start("record", command=[*command, "--include", "/odom"])
    peer.wait_matched(topics.ODOM)
    recorder.wait_output("recording to")
    wait_for(lambda: any(item.stat().st_size for item in (tmp_path / "ride").glob("*.mcap")), "a recording")
    recorder.signal(signal.SIGINT)
    assert recorder.wait() == 0
    (recording,) = (tmp_path / "ride").glob("*.mcap")
    assert b"/odom" in recording.read_bytes()


def test_run_starts_a_node_with_its_arguments(start: Callable[..., NodeProcess]) -> None:
    command = [sys.executable, "-m", "robot_stack.cli", "run", "safety_monitor", "--ros-args", "-p", "tick_hz:=-1.0"]
    process = start("run", command=command)
    assert process.wait() == 2
    assert "tick_hz" in process.output()
