"""The systemd units and the container: they start the installed stack, keep its state, and have minimal rights."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from robot_stack.core.config import load
from robot_stack.core.runtime import data_home, state_dir, state_home
from robot_stack.supervisor.profile import load_plan
from robot_stack.ui.params import TouchUiParams

SCRIPTS = Path(__file__).resolve().parents[2] / "launch_scripts"
UNIT, KIOSK = SCRIPTS / "robot-stack.service", SCRIPTS / "robot-stack-kiosk.service"
BRIDGE = SCRIPTS / "robot-stack-wmx-bridge.service"
needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd on this machine")


@needs_systemd
@pytest.mark.parametrize("unit", [UNIT, KIOSK, BRIDGE], ids=lambda path: path.name)
def test_the_unit_is_understood(unit: Path) -> None:
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    said = [line for line in done.stderr.splitlines() if "is not executable" not in line]  # not installed here
    assert said == []


@needs_systemd
def test_service_has_low_security_exposure() -> None:
    """For comparison: a unit without any hardening has an exposure of 9.2 of 10."""
    command = ["systemd-analyze", "security", "--offline=true", "--no-pager", str(UNIT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    level = re.search(r"Overall exposure level for \S+: ([0-9.]+)", done.stdout)
    assert level is not None, done.stdout
    assert float(level[1]) < 3.0


@pytest.mark.skipif(shutil.which("systemd-sysusers") is None, reason="no systemd on this machine")
def test_the_user_is_a_system_user_and_the_one_of_the_unit() -> None:
    file = SCRIPTS / "robot-stack.sysusers"
    done = subprocess.run(["systemd-sysusers", "--dry-run", str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^u robot - .* /var/lib/robot_stack$", file.read_text(), re.MULTILINE)
    assert "User=robot\n" in UNIT.read_text()
    assert re.search(r"^u screen - ", file.read_text(), re.MULTILINE)
    assert "User=screen\n" in KIOSK.read_text()


def test_the_kiosk_shows_the_page_of_the_stack() -> None:
    assert f"--app=http://127.0.0.1:{load(TouchUiParams, 'touch_ui').server.port}/ " in KIOSK.read_text()


def test_the_containers_start_profiles_of_the_stack_with_the_units_limits() -> None:
    folder = SCRIPTS / "docker"
    services = yaml.safe_load((folder / "compose.yaml").read_text())["services"]
    default = re.search(r"^CMD (\[.*\])$", (folder / "Dockerfile").read_text(), re.MULTILINE)
    assert default is not None
    commands = [yaml.safe_load(default[1]), services["robot"]["command"]]
    assert [command[-1] for command in commands] == ["sim", "robot"]
    for command in commands:
        load_plan(command[-1])
    assert f"LimitRTPRIO={services['robot']['ulimits']['rtprio']}\n" in UNIT.read_text()
    assert (folder / services["simulation"]["build"]["context"]).resolve() == SCRIPTS.parent


def test_the_containers_volumes_keep_state_and_data_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """Docker creates a mount point that the image does not contain as root."""
    for variable in ("STATE_DIRECTORY", "XDG_STATE_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", "/home/robot")
    folder = SCRIPTS / "docker"
    made = re.search(r"install --directory --owner robot (.*)$", (folder / "Dockerfile").read_text(), re.MULTILINE)
    assert made is not None
    for service in yaml.safe_load((folder / "compose.yaml").read_text())["services"].values():
        points = {mount.split(":")[1] for mount in service["volumes"] if not mount.startswith(".")}
        assert points == {str(state_home().parent), str(data_home().parent)}
        assert {"/home/robot/.local", *points} <= set(made[1].split())


def test_the_rules_name_the_ports_of_the_services_domain_and_of_its_pages() -> None:
    text = UNIT.read_text()
    assert "ROS_DOMAIN_ID=0 " in text
    defined = "-D robot=robot -D screen=screen -D ports=7400-7649 -D pages=8460-8479"
    assert f"ExecStartPre=+/usr/sbin/nft {defined} -f /opt/robot_stack/" in text
    server = load(TouchUiParams, "touch_ui").server
    assert f"pages={server.port}-{server.port + server.ports - 1} " in defined + " "


def test_no_other_user_can_create_the_runtime_folder_first() -> None:
    text = UNIT.read_text()
    assert "RuntimeDirectory=robot_stack\nRuntimeDirectoryMode=0700\n" in text
    assert "Environment=ROBOT_STACK_RUNTIME_DIR=/run/robot_stack\n" in text


def test_the_state_lies_in_the_services_state_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same folder for the service, by systemd's variable, and for an operator's shell."""
    text = UNIT.read_text()
    assert "StateDirectory=robot_stack\n" in text
    assert "XDG_STATE_HOME=/var/lib " in text
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    monkeypatch.setenv("XDG_STATE_HOME", "/var/lib")
    of_shell = state_dir()
    monkeypatch.setenv("XDG_STATE_HOME", "/elsewhere")
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/robot_stack:/var/lib/more")
    assert state_dir() == of_shell == Path("/var/lib/robot_stack/domain-7")


def test_the_motion_engine_outlives_its_bridge() -> None:
    """It is a child of the bridge, and the dead-man for the death of the bridge."""
    lines = BRIDGE.read_text().splitlines()
    assert "KillMode=process" in lines
    assert "OOMPolicy=continue" in lines
    assert not [line for line in lines if line.startswith("PrivateTmp=")], "the next bridge finds the engine's files"
