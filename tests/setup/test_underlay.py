"""The environment beside a sourced ROS installation: a stand-in whose rclpy and libraries cannot be loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.sourced import source

ROOT = Path(__file__).resolve().parents[2]
PREFIX = Path(sys.prefix)
SITE = f"lib/python{sys.version_info.major}.{sys.version_info.minor}/site-packages"


def output(command: list[str | Path], environment: dict[str, str]) -> str:
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.fixture
def sourced(tmp_path: Path) -> dict[str, str]:
    return source(tmp_path / "ros", dict(os.environ))


def test_the_stand_in_would_break_an_interpreter_without_the_hook(sourced: dict[str, str]) -> None:
    base = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    result = subprocess.run([base, "-c", "import rclpy"], env=sourced, capture_output=True, text=True, check=False)
    assert "the stand-in's rclpy" in result.stderr


def test_the_interpreter_loads_its_own_ros(sourced: dict[str, str]) -> None:
    program = (
        "import rclpy, custom_msgs.msg as m; from rclpy.serialization import serialize_message as s;"
        "s(m.Heartbeat()); print(rclpy.__file__)"
    )
    assert output([sys.executable, "-c", program], sourced).startswith(str(PREFIX))


@pytest.mark.parametrize("variable", ["PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH"])
def test_children_inherit_nothing_of_it(sourced: dict[str, str], variable: str, tmp_path: Path) -> None:
    program = f"import os; print(os.environ.get({variable!r}, ''))"
    assert str(tmp_path) not in output([sys.executable, "-c", program], sourced)


def test_other_entries_stay(sourced: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    sourced["PYTHONPATH"] += f"{os.pathsep}{tmp_path / 'mine'}"
    program = "import os, sys; print(os.environ['PYTHONPATH']); print(sys.path)"
    variable, path = output([sys.executable, "-c", program], sourced).splitlines()
    assert variable == str(tmp_path / "mine")
    assert str(tmp_path / "mine") in path


def test_a_workspace_on_the_environment_itself_stays(tmp_path: Path) -> None:
    module = tmp_path / "install" / SITE / "added"
    module.mkdir(parents=True)
    (module / "__init__.py").touch()
    environment = {
        **os.environ,
        "AMENT_PREFIX_PATH": f"{tmp_path / 'install'}{os.pathsep}{PREFIX}",
        "PYTHONPATH": str(module.parent),
    }
    program = "import added, os; print(added.__file__, os.environ['AMENT_PREFIX_PATH'])"
    assert output([sys.executable, "-c", program], environment).count(str(tmp_path)) == 2


def test_the_command_line_starts(sourced: dict[str, str]) -> None:
    assert "up" in output([PREFIX / "bin/robot-stack", "--help"], sourced)


def test_the_shells_environment_names_the_nodes(sourced: dict[str, str], tmp_path: Path) -> None:
    script = ROOT / "launch_scripts/environment.sh"
    shown = output(["bash", "-c", f"source '{script}' && command -v robot-stack && echo $AMENT_PREFIX_PATH"], sourced)
    assert shown.splitlines() == [f"{PREFIX}/bin/robot-stack", f"{PREFIX}{os.pathsep}{tmp_path / 'ros'}"]


def test_a_node_launcher_loads_its_own_ros(sourced: dict[str, str], tmp_path: Path) -> None:
    launcher = (PREFIX / "lib/robot_stack/swerve_controller").read_text()
    probe = tmp_path / "probe"
    probe.write_text(
        launcher.split("exec ")[0] + f"exec '{sys.executable}' -c \"import rclpy; print(rclpy.__file__)\"\n"
    )
    assert output(["/bin/sh", probe], sourced).startswith(str(PREFIX))
