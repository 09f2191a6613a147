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
from tests.support.command_line import Done, cli
from tests.support.fake_safety import FakeSafety
from tests.support.peer import Peer
from tests.support.processes import ROOT, Start
from tests.support.waiting import wait_for

COMMAND = [sys.executable, "-m", "robot_stack.cli"]


# --- without ROS ------------------------------------------------------------------------------------------------------


def test_help_names_every_verb_and_imports_no_ros() -> None:
    code = "import sys; from robot_stack.cli.app import app; print(sorted(sys.modules))"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True).stdout
    assert [heavy for heavy in ("rclpy", "numpy", "pydantic", "custom_msgs") if f"'{heavy}'" in modules] == []
    shown = cli("--help").stdout
    verbs = "up down status restart run mission estop reset topics record doctor bench simulate docking view film"
    assert [verb for verb in verbs.split() if f" {verb} " not in shown] == []
    listed = cli("bench").stdout
    assert [name for name in ("stop:", "rates:", "startup:") if name not in listed] == []


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ("status", 1, "error: no stack is running in ROS domain "),
        ("restart x", 1, "error: no stack is running in ROS domain "),
        ("up --profile nothing", 2, "there is no profile 'nothing'; known profiles: diff_drive, diff_drive_real, gen"),
        ("up --only nobody", 2, "--only: nobody: not a built process of this profile"),
        ("up --set swerve_controller", 2, "must read node.parameter=value"),
        ("up --profile robot --speed 2", 2, "no simulated world"),
        ("bench nothing", 1, "there is no benchmark 'nothing'; known: "),
        ("docking markers --pdf /proc/boards.pdf", 1, "/proc/boards.pdf cannot be written"),
        ("docking markers --pdf a.pdf --dock no", 2, "there is no dock 'no'; known docks: chair_1, charger"),
        ("docking replay /nowhere --output /tmp", 2, "/nowhere cannot be read"),
        ("dock chair_9", 1, "error: there is no dock 'chair_9'; known: chair_1, charger"),
    ],
)
def test_wrong_use_is_one_clear_line(ros_domain: int, arguments: str, code: int, message: str) -> None:
    done = cli(*arguments.split())
    assert message in done.stderr
    assert (done.returncode, done.stderr.count("\n")) == (code, 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("estop", "did not confirm it: use the button"),
        ("reset", "/emergency_stop has no subscriber: is the stack running?"),
        ("mission pause", "no mission manager answers: is the stack running?"),
        ("docking status", "no /docking/status: is the stack running?"),
        ("dock chair_1", "no docking_controller offers /docking/dock: is it running?"),
    ],
)
def test_without_the_node_that_answers(ros_domain: int, arguments: str, message: str) -> None:
    done = cli(*arguments.split(), "--timeout", "0.5")
    assert done.returncode == 1
    assert message in done.stderr


@pytest.fixture
def own_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the configuration that a test may change."""
    folder = Path(shutil.copytree(config_dir(), tmp_path / "config"))
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    return folder


def test_missions_are_listed_and_a_malformed_one_is_named(own_config: Path) -> None:
    done = cli("mission", "list")
    assert (done.returncode, "yard_tour: Yard tour, " in done.stdout) == (0, True)
    (own_config / "missions" / "short_hop.yaml").write_text("id: short_hop\nwaypoints: 5\n")
    done = cli("mission", "list")
    assert done.returncode == 1
    assert [text for text in ("short_hop: ", "waypoints", "yard_tour: Yard tour") if text not in done.stdout] == []


class TestDoctor:
    def findings(self) -> tuple[int, dict[str, list[dict[str, str]]]]:
        done = cli("doctor", "--json")
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

    def test_all_that_is_wrong_is_named_with_advice(self, own_config: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        wrong = (
            ("robot.yaml", "wheel_radius_m: -1", "wheel_radius_m"),
            ("swerve_controller.yaml", "surprise: 1", "surprise"),
            ("profiles/sim.yaml", "machine: boat", "machine"),
            ("worlds/flat.yaml", "[", "not valid YAML"),
        )
        for file, text, _ in wrong:
            (own_config / file).write_text(text)
        monkeypatch.setenv("ROS_DOMAIN_ID", "300")
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
        code, found = self.findings()
        assert code == 1
        worse = [entry for entries in found.values() for entry in entries if entry["level"] != "ok"]
        assert all(entry["advice"] for entry in worse)
        assert found["network"][0]["level"] == "note"
        assert "0..232" in found["ROS domain"][0]["what"]
        problems = " ".join(entry["what"] for entry in found["configuration"])
        assert [text for file, _, field in wrong for text in (file, field) if text not in problems] == []


# --- emergency stop and reset -----------------------------------------------------------------------------------------


@pytest.fixture
def safety(peer: Peer) -> FakeSafety:
    peer.listen(topics.EMERGENCY_STOP_SOURCES)  # as the safety monitor does: the tool waits for it
    return FakeSafety(peer)


def reset_fails(*arguments: str) -> Done:
    done = cli("reset", *arguments)
    assert done.returncode == 1
    return done


def test_estop_is_sent_and_confirmed(safety: FakeSafety) -> None:
    safety.obeys = False

    def sent() -> list[bool]:
        done = cli("estop", "--timeout", "2")
        assert done.returncode == 1
        assert "did not confirm it: use the button" in done.stderr
        return safety.requests

    assert all(wait_for(sent, "the stop, although nothing confirms it"))
    safety.obeys = True
    done = cli("estop")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("emergency stop, confirmed after ")
    assert safety.active


def test_reset_sends_false_then_releases_emergency_stop(safety: FakeSafety) -> None:
    safety.active = True
    safety.refusals = ["released a moment ago"]  # the monitor must see the release first
    done = cli("reset")
    assert done.returncode == 0, done.stderr
    assert "released: ESTOP_PRESSED" in done.stdout
    assert safety.requests == [False]
    assert not safety.active
    safety.active = True
    safety.refusals = ["refused: the robot moves at 0.40 m/s"] * 100
    done = reset_fails()
    assert done.stderr.startswith("error: refused: the robot moves at 0.40 m/s; ")
    assert "robot-stack reset --clear NAME" in done.stderr
    assert safety.active


def test_sources_that_are_gone_are_cleared_by_name_before_the_reset(safety: FakeSafety) -> None:
    safety.active = True
    safety.uncleared = "refused: touch_ui is running and reports that it is pressed: release it there"
    assert "release it there" in reset_fails("--clear", "touch_ui").stderr
    assert safety.active
    safety.uncleared = ""
    safety.cleared.clear()
    done = cli("reset", "--clear", "touch_ui", "--clear", "unknown")
    assert done.returncode == 0, done.stderr
    assert safety.cleared == ["robot_stack_cli", "touch_ui", "unknown"]
    assert not safety.active


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


def test_mission_commands(missions: FakeMissions) -> None:
    done = cli("mission", "start", "nowhere")
    assert (done.returncode, done.stderr) == (1, "error: START_MISSION was refused: there is no such mission\n")
    done = cli("mission", "start", "yard_tour")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "RUNNING, yard_tour 0/10 waypoints, 0%\n"
    for verb in ("pause", "resume", "abort"):
        assert cli("mission", verb).returncode == 0
    started = [("START_MISSION", "nowhere"), ("START_MISSION", "yard_tour")]
    assert missions.commands == [*started, ("PAUSE", ""), ("RESUME", ""), ("ABORT", "")]
    missions.status.state, missions.status.eta_s = "RUNNING", 12.0
    missions.status.current_waypoint, missions.status.progress, missions.status.waypoints_completed = "lane", 0.5, 1
    missions.publish()
    done = cli("mission", "watch", "--once")
    assert done.returncode == 0
    assert "RUNNING, yard_tour 1/10 waypoints, 50%, to lane, 12 s left" in done.stdout


# --- docking ----------------------------------------------------------------------------------------------------------


def test_docking_status_prints_each_state_and_missing_messages(peer: Peer, start: Start) -> None:
    status = DockingStatus(state="SERVOING", position_error=0.1234, orientation_error=-0.01, visible_markers_count=4)
    peer.repeat(topics.DOCKING_STATUS, lambda: status, 10.0)
    done = cli("docking", "status", "--once")
    assert (done.returncode, done.stdout) == (0, "SERVOING, 123.4 mm, -0.57 deg, 4 markers, 0%\n")
    watching = start(command=[*COMMAND, "docking", "status"])
    watching.wait_output("SERVOING, 123.4 mm")
    status.state, status.position_error, status.visible_markers_count = "FAILED", float("nan"), 1
    watching.wait_output("FAILED, -0.57 deg, 1 marker")
    peer.silence(topics.DOCKING_STATUS)
    watching.wait_output("no /docking/status for")
    watching.signal(signal.SIGINT)
    assert watching.wait() == 0


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


Found = dict[str, dict[str, Any]]


def measure(profile: str, holds: Callable[[Found, list[str]], bool]) -> Found:
    """The topics, and that they and the unknown ones meet the condition once all are discovered."""

    def found() -> Found | None:
        done = cli("topics", "--profile", profile, "--json", "--window", "0.5")
        assert done.returncode == 1
        result = json.loads(done.stdout)
        found = {entry["name"]: entry for entry in result["topics"]}
        return found if holds(found, result["unknown"]) else None

    measured = wait_for(found, "the topics")
    assert measured is not None
    return measured


def test_topics_are_compared_with_the_contract(controller: Peer, peer: Peer, drive_profile: str) -> None:
    controller.repeat(topics.ODOM, Odometry, 50.0)

    def as_in_the_contract(found: Found, unknown: list[str]) -> bool:
        odom = found["/odom"]
        # On a busy machine the rate is below the contract's.
        wrong = [problem for problem in odom["problems"] if "Hz instead of" not in problem]
        return (odom["publishers"], wrong, unknown) == (["swerve_controller"], [], [])

    found = measure(drive_profile, as_in_the_contract)
    assert found["/swerve/wheel_commands"]["problems"] == ["not published by swerve_controller"]
    assert found["/sensors/imu"]["verdict"] == "not run"
    done = cli("topics", "--once", "--profile", drive_profile, "--window", "0.5")
    assert done.returncode == 1
    assert "topics differ from the contract" in done.stdout

    controller.silence(topics.ODOM)
    controller.node.create_publisher(Odometry, topics.ODOM.name, 10)
    peer.publisher(topics.ODOM)
    controller.node.create_publisher(String, topics.WHEEL_COMMANDS.name, qos_profile(topics.WHEEL_COMMANDS.qos))
    controller.node.create_publisher(String, "/mine", 1)
    wrong = {
        "published by peer, which the contract does not name",
        "swerve_controller publishes RELIABLE, VOLATILE",
        "advertised, but nothing is sent",
    }
    another = "type std_msgs/msg/String in the graph"

    def as_changed(found: Found, unknown: list[str]) -> bool:
        odom, commands = (found[name]["problems"] for name in ("/odom", "/swerve/wheel_commands"))
        return wrong <= set(odom) and another in commands and unknown == ["/mine"]

    measure(drive_profile, as_changed)


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
        meter.run(1.0)
        rate_hz = meter.seen()["/odom"].traffic.rate_hz
    # A busy machine ticks slower: clock and odometry alike, so the rate stays.
    assert rate_hz == pytest.approx(50.0, rel=0.1)


# --- programs ---------------------------------------------------------------------------------------------------------


def test_record_writes_until_interrupted(start: Start, peer: Peer, tmp_path: Path) -> None:
    peer.repeat(topics.ODOM, Odometry, 50.0)
    command = [*COMMAND, "record", "--output", str(tmp_path), "--name", "ride"]
    recorder = start("record", command=[*command, "--include", "/odom"])
    peer.wait_matched(topics.ODOM)
    recorder.wait_output("recording to")
    # Each chunk of messages names it.
    wait_for(lambda: any(b"zstd" in item.read_bytes() for item in (tmp_path / "ride").glob("*.mcap")), "a message")
    recorder.signal(signal.SIGINT)
    assert recorder.wait() == 0
    (recording,) = (tmp_path / "ride").glob("*.mcap")
    assert b"/odom" in recording.read_bytes()


def test_simulate_passes_its_options_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command that a run prints to repeat it may have any of them."""
    started: list[list[str]] = []
    monkeypatch.setattr(os, "execve", lambda _, command, __: started.append(command))
    cli("simulate", "--from", "ride@42", "--until", "20")
    cli("simulate", "--help")
    assert [command[3:] for command in started] == [["--from", "ride@42", "--until", "20"], ["--help"]]


def test_run_starts_a_node_with_its_arguments(start: Start) -> None:
    command = [*COMMAND, "run", "safety_monitor", "--ros-args", "-p", "tick_hz:=-1.0"]
    process = start("run", command=command)
    assert process.wait() == 2
    assert "tick_hz" in process.output()
    process = start("run", command=[*COMMAND, "run", "nobody"])
    assert process.wait() == 2
    assert process.output().startswith("error: nobody is not a node of this stack; nodes that can run:")
