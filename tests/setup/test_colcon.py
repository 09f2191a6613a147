"""The repository's folders are ordinary ROS 2 packages: colcon finds and builds them on an installed ROS 2."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robot_stack.contract.processes import available
from robot_stack.core.wheels_env import ros_environment

ROOT = Path(__file__).resolve().parents[2]
PREFIX = Path(sys.prefix)
PACKAGES = ("control_msgs", "custom_msgs", "nav2_msgs", "robot_stack", "tf2_msgs", "wmx_ros2_message")
PROJECT_INCLUDE = Path(__file__).with_name("colcon_build.cmake")


def environment() -> dict[str, str]:
    """The environment after sourcing an installed ROS 2; here that is the virtual environment."""
    foreign = ("PYTHONPATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "LD_LIBRARY_PATH")
    clean = {key: value for key, value in os.environ.items() if key not in foreign}
    path = f"{PREFIX / 'bin'}{os.pathsep}{clean.get('PATH', '')}"
    # Without flags of ours, colcon's own let a build wait while other tests keep the processor busy.
    flags = {"MAKEFLAGS": "-j2", "CMAKE_BUILD_PARALLEL_LEVEL": "2"}
    return {**clean, **flags, **ros_environment(base={}), "CMAKE_PREFIX_PATH": str(PREFIX), "PATH": path}


def run(command: list[str], folder: Path) -> str:
    result = subprocess.run(
        command, cwd=folder, env=environment(), stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, f"{' '.join(command)}\n{result.stdout[-4000:]}\n{result.stderr[-4000:]}"
    return result.stdout


def run_in(workspace: Path, program: str) -> list[str]:
    """Output lines of a Python program in the sourced install space, started outside of the repository."""
    return run(["bash", "-c", f"source install/setup.bash && python - <<'END'\n{program}\nEND"], workspace).splitlines()


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("workspace")
    (folder / "src").mkdir()
    for package in PACKAGES:
        (folder / "src" / package).symlink_to(ROOT / package)
    build = ["colcon", "build", "--parallel-workers", "2", "--cmake-args", "-GNinja", "-DBUILD_TESTING=OFF"]
    run([*build, f"-DCMAKE_PROJECT_INCLUDE={PROJECT_INCLUDE}"], folder)
    return folder


def test_colcon_finds_the_packages_in_the_repository() -> None:
    """colcon would list an invalid package.xml as another type, or not at all."""
    listing = run(["colcon", "--log-base", os.devnull, "list", "--base-paths", str(ROOT)], ROOT)

    found = {(name, kind) for name, _, kind in (line.split("\t") for line in listing.splitlines())}
    assert found == {(package, "(ros.ament_cmake)") for package in PACKAGES}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_messages_of_the_install_space_serialize(workspace: Path) -> None:
    program = """
from rclpy.serialization import deserialize_message, serialize_message
import control_msgs.action, custom_msgs.msg, nav2_msgs.action, tf2_msgs.msg, wmx_ros2_message.srv
for package in (custom_msgs, control_msgs, nav2_msgs, tf2_msgs, wmx_ros2_message):
    print(package.__file__, end=" ")
print()
sent = custom_msgs.msg.VelocityLimit(max_linear_velocity=0.25, reason="SLOPE")
print(deserialize_message(serialize_message(sent), custom_msgs.msg.VelocityLimit) == sent)
"""
    files, equal = run_in(workspace, program)

    assert all(Path(file).is_relative_to(workspace / "install") for file in files.split())
    assert equal == "True"


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_stack_of_the_install_space_imports_with_its_configuration(workspace: Path) -> None:
    program = """
import robot_stack, sim
from robot_stack.core.config import config_dir
print(robot_stack.__file__, sim.__file__, config_dir())
"""
    (files,) = run_in(workspace, program)

    assert all(Path(file).is_relative_to(workspace / "install" / "robot_stack") for file in files.split())
    share = workspace / "install" / "robot_stack" / "share" / "robot_stack"
    launch_files = {path.name for path in (ROOT / "launch_scripts" / "launch").glob("*.launch.py")}
    assert {path.name for path in (share / "launch").glob("*.launch.py")} == launch_files


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_built_node_is_an_executable_of_the_package(workspace: Path) -> None:
    launchers = list((workspace / "install/robot_stack/lib/robot_stack").iterdir())

    assert {path.name for path in launchers} == {process.name for process in available()}
    assert all(os.access(path, os.X_OK) for path in launchers)
