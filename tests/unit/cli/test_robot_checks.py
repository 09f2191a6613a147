"""doctor --robot: each step of the commissioning guide is found done, or named with what to do."""

from __future__ import annotations

import json
import math
import shutil
import time
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import yaml

from robot_stack.cli import robot_checks
from robot_stack.cli.checks import Finding, Level, examine
from robot_stack.contract.frames import JOINTS, STEER_AXES
from robot_stack.core.robot import load_robot
from robot_stack.supervisor.profile import load_plan
from robot_stack.ui.nodes.self_test_file import SelfTestFile
from robot_stack.ui.pin import hash_pin
from robot_stack.ui.self_test import Verdict
from robot_stack.ui.self_test_record import Record
from robot_stack.wmx.api import EngineState
from robot_stack.wmx.axes import Flag, StatusSnapshot, empty_snapshot
from robot_stack.wmx.config import load_client_config, load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.status_writer import StatusWriter
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from tests.support.processes import ROOT

ROBOT = load_robot()
DAY_S = 86_400.0


def levels(findings: list[Finding], check: str) -> list[Level]:
    return [finding.level for finding in findings if finding.check == check]


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = shutil.copytree(ROOT / "config", tmp_path / "config")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return folder


def set_in(file: Path, *path: str, value: object) -> None:
    data = yaml.safe_load(file.read_text())
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    file.write_text(yaml.safe_dump(data))


# --- computer and service ---------------------------------------------------------------------------------------------


def test_a_group_that_a_driver_needs_is_missing() -> None:
    drivers = ["xsens_driver", "v4l2_camera_driver", "swerve_controller"]
    found = list(robot_checks.group_findings(drivers, {"dialout"}))
    assert [(item.level, item.advice) for item in found] == [
        (Level.OK, ""),
        (Level.BAD, "usermod -aG video robot"),
    ]
    assert found[0].what == "robot is in the group dialout, for xsens_driver"


def test_the_shipped_user_has_the_groups_that_the_profiles_drivers_need() -> None:
    lines = (ROOT / "launch_scripts" / "robot-stack.sysusers").read_text().splitlines()
    members = {line.split()[2] for line in lines if line.startswith("m robot ")}
    profile = yaml.safe_load((ROOT / "config" / "profiles" / "robot.yaml").read_text())["processes"]
    found = list(robot_checks.group_findings(profile, members))
    assert found
    assert all(item.level is Level.OK for item in found)


def test_unit_files_are_missing_old_or_current(tmp_path: Path) -> None:
    current, old = tmp_path / "systemd/system/robot-stack.service", tmp_path / "sysusers.d/robot-stack.conf"
    for path in (current, old):
        path.parent.mkdir(parents=True)
    shutil.copy(ROOT / "launch_scripts" / "robot-stack.service", current)
    old.write_text("u robot -\n")
    found = {Path(item.what.split()[0]).name: item.level for item in robot_checks.unit_files(tmp_path)}
    assert found == {
        "robot-stack.service": Level.OK,
        "robot-stack-kiosk.service": Level.BAD,
        "robot-stack.conf": Level.NOTE,
    }


# --- engine -----------------------------------------------------------------------------------------------------------


def snapshot(released: bool = True, **flags: dict[str, int]) -> StatusSnapshot:
    """A communicating engine with all homes; flags: by row of ``Flag``, then by joint."""
    empty = empty_snapshot(max(axis.number for axis in ROBOT.axes.values()) + 1)
    empty.flags[Flag.HOME_DONE], empty.flags[Flag.SERVO_OFFLINE] = 1, 0
    for row, values in flags.items():
        for joint, value in values.items():
            empty.flags[Flag[row], ROBOT.axes[joint].number] = value
    inputs = np.zeros(ROBOT.estop_input_byte + 1, np.uint8)
    inputs[ROBOT.estop_input_byte] = int(released) << ROBOT.estop_input_bit
    return replace(empty, engine_state=EngineState.Communicating, inputs=inputs)


def test_axes_homes_and_the_stop_input_are_read() -> None:
    found = list(robot_checks.axis_findings(snapshot(), ROBOT))
    assert [(item.check, item.level) for item in found] == [("home", Level.OK), ("hardware stop", Level.OK)]
    steering = JOINTS[STEER_AXES[1]]
    bad = list(robot_checks.axis_findings(snapshot(released=False, HOME_DONE={steering: 0}), ROBOT))
    assert [(item.check, item.level) for item in bad] == [("home", Level.BAD), ("hardware stop", Level.BAD)]
    assert steering in bad[0].what
    alarm = snapshot(AMP_ALARM={"fl_drive": 1}, AMP_ALARM_CODE={"fl_drive": 0x7500})
    assert next(iter(robot_checks.axis_findings(alarm, ROBOT))).what == "alarm of fl_drive 0x7500"
    for row in ("SERVO_OFFLINE", "FOLLOWING_ERROR_ALARM"):
        axes = next(iter(robot_checks.axis_findings(snapshot(**{row: {"fl_drive": 1}}), ROBOT)))
        assert (axes.check, axes.level) == ("axes", Level.BAD)
        assert axes.what.endswith(": fl_drive")
    (silent,) = robot_checks.axis_findings(empty_snapshot(8), ROBOT)
    assert (silent.check, silent.level) == ("engine", Level.BAD)


# --- sensors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("acceleration", "level"),
    [
        ((0.1, -0.2, 9.8), Level.OK),
        ((1.2, 0.0, 9.7), Level.BAD),  # 7 deg
        ((0.0, 0.0, -9.8), Level.BAD),  # upside down
        ((0.0, 0.0, 1.0), Level.BAD),  # in g
        ((0.0, math.nan, 9.8), Level.BAD),
    ],
)
def test_the_inertial_unit_stands_upright(acceleration: tuple[float, float, float], level: Level) -> None:
    assert robot_checks.level_finding(*acceleration).level is level


# --- screen, map, docks -----------------------------------------------------------------------------------------------


def test_a_staff_pin_is_set_and_not_the_public_one(config: Path) -> None:
    def found() -> Level:
        return levels(list(robot_checks.staff_pin()), "staff PIN")[0]

    for pin, level in (("", Level.BAD), ("2468", Level.BAD), ("8642", Level.OK)):
        set_in(config / "touch_ui.yaml", "access", "pin_hash", value=hash_pin(pin) if pin else "")
        assert found() is level, pin


def test_the_self_test_of_the_stop_buttons_has_passed(config: Path) -> None:
    def found() -> Level:
        return levels(list(robot_checks.self_test()), "self test")[0]

    def add(verdict: Verdict, age_s: float) -> None:
        at_s = datetime.now().timestamp() - age_s
        SelfTestFile().add(Record(at_s=at_s, at="then", who="staff", verdict=verdict, duration_s=60.0, step="press"))

    assert found() is Level.BAD
    add(Verdict.PASSED, 60.0 * DAY_S)
    assert found() is Level.NOTE
    add(Verdict.PASSED, 60.0)
    assert found() is Level.OK
    add(Verdict.FAILED, 30.0)
    assert found() is Level.BAD


def test_the_nodes_use_one_map_that_is_there(config: Path) -> None:
    assert levels(list(robot_checks.site_map()), "map") == [Level.OK]
    set_in(config / "navigation_controller.yaml", "map", value="elsewhere")
    found = list(robot_checks.site_map())
    assert levels(found, "map") == [Level.BAD, Level.BAD, Level.OK]
    assert "navigation_controller: elsewhere" in found[0].what
    assert levels(list(robot_checks.map_findings({"ndt_localization": ""})), "map") == [Level.BAD]


def test_docks_are_named(config: Path) -> None:
    (finding,) = robot_checks.docks()
    assert (finding.level, finding.what) == (Level.OK, "chair_1 (wheelchair), charger (charger)")
    (config / "docks.yaml").write_text("docks: 5\n")
    assert levels(list(robot_checks.docks()), "docks") == [Level.BAD]


def test_places_in_keepout_zones_are_named(config: Path) -> None:
    _, _, finding = robot_checks.zones()
    assert (finding.level, finding.what[:14]) == (Level.OK, "0 keepout zone")
    ring = [[2.5, 0.3], [3.5, 0.3], [3.5, 1.3], [2.5, 1.3], [2.5, 0.3]]
    lawn = {
        "type": "Feature",
        "properties": {"name": "lawn", "type": "keepout"},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    zones_file = config / "maps" / "yard" / "zones.geojson"
    zones_file.write_text(json.dumps({"type": "FeatureCollection", "features": [lawn]}))
    set_in(config / "safe_places.yaml", "places", value=[{"name": "porch", "x": 3.0, "y": 0.5, "yaw": 0.0}])
    found = list(robot_checks.zones())
    assert levels(found, "zones") == [Level.BAD] * (len(found) - 2)
    text = "\n".join(item.what for item in found)
    assert "the safe place 'porch': the footprint with a wheelchair lies in the keepout zone 'lawn'" in text
    assert "waypoint 'stop' of 'short_hop': the footprint lies in the keepout zone 'lawn'" in text
    assert "chair_1" not in text
    zones_file.write_text("{}")
    _, _, finding = robot_checks.zones()
    assert finding.level is Level.BAD
    assert "zones.geojson" in finding.what


def test_the_file_of_zones_in_force_is_named_and_whether_it_can_be_written(config: Path, tmp_path: Path) -> None:
    def finding() -> Finding:
        found = next(robot_checks.zones())
        assert found.check == "zone file"
        return found

    site, own = config / "maps" / "yard" / "zones.geojson", tmp_path / "data" / "robot_stack" / "zones" / "yard.geojson"
    assert (finding().level, finding().what) == (Level.OK, f"{site} (none); edits are saved in {own}")
    own.parent.mkdir(parents=True)
    own.write_text(json.dumps({"type": "FeatureCollection", "features": []}))
    assert (finding().level, finding().what.split(";")[0]) == (
        Level.OK,
        f"{own}, edited on this robot, instead of {site}",
    )
    own.unlink()
    own.parent.rmdir()
    own.parent.symlink_to("/proc/self")  # where no user can make files
    assert finding().level is Level.BAD
    assert f"{own} cannot be written" in finding().what


def test_a_driver_that_was_not_started_is_named() -> None:
    (found,) = robot_checks.driver_findings({"xsens_driver", "pylontech_driver"}, {"xsens_driver"})
    assert (found.level, found.what) == (Level.BAD, "pylontech_driver was not started")


@pytest.mark.parametrize(
    ("runs", "level", "words"),
    [("", Level.NOTE, "robot-stack up"), ("service", Level.BAD, ""), ("sim", Level.BAD, "profile sim runs")],
    ids=["no stack", "another's service", "another profile"],
)
def test_what_needs_the_running_robot_is_not_called_good_without_it(
    config: Path, monkeypatch: pytest.MonkeyPatch, ros_domain: int, runs: str, level: Level, words: str
) -> None:
    if runs == "service":
        monkeypatch.setattr(robot_checks, "SERVICE_FOLDER", config)
    elif runs:
        monkeypatch.setattr(robot_checks, "running_plan", lambda: load_plan("sim"))
    found = examine(robot_checks.robot_checks())
    for check in ("engine", "sensors", "inertial unit", "external display"):
        assert levels(found, check) == [level], check
        assert words in "".join(item.what + item.advice for item in found if item.check == check)
    assert not [item for item in found if "the check failed" in item.what]


def test_an_engine_that_does_not_run_is_not_started(tmp_path: Path) -> None:
    client = load_client_config("simulated").model_copy(update={"path": str(tmp_path)})
    absent = robot_checks.engine_absent(client)
    assert (absent.level, absent.what.split()[1]) == (Level.BAD, "StatusChannelNull")
    config = load_engine_config()
    motors = Engine(config, VirtualDrives(config.n_axes, config.cycle_time_s))
    StatusWriter(motors, tmp_path).publish(time.monotonic_ns())
    idle = robot_checks.engine_absent(client.model_copy(update={"status_stale_s": 60.0}))
    assert idle.what == "it does not run"
