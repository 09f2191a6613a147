"""The environment made by the set-up: nodes in the ament index, launchers, message transport."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract.processes import available
from robot_stack.core.wheels_env import ros_environment
from tests.contract.type_hashes import OWN_LOCK, UPSTREAM_LOCK, locked
from tests.support.waiting import wait_for

PREFIX = Path(sys.prefix)


def wheels_prefix(folder: Path) -> Path:
    (folder / "lib/python3.12/site-packages/ros_b.libs").mkdir(parents=True)
    (folder / "lib/python3.12/site-packages/ros_a.libs").mkdir()
    return folder


def test_environment_names_the_wheels_libraries_before_inherited_ones(tmp_path: Path) -> None:
    prefix = wheels_prefix(tmp_path)
    site = prefix / "lib/python3.12/site-packages"

    variables = ros_environment(prefix, {"LD_LIBRARY_PATH": f"/opt/lib::{prefix}/lib", "AMENT_PREFIX_PATH": "/opt/ros"})

    assert variables["LD_LIBRARY_PATH"] == f"{prefix}/lib:{site}/ros_a.libs:{site}/ros_b.libs:/opt/lib"
    assert variables["AMENT_PREFIX_PATH"] == f"{prefix}:/opt/ros"
    assert variables["_ROS_WHEELS_BOOTSTRAP_COMPLETE"] == "1"


def test_environment_is_stable_when_applied_twice(tmp_path: Path) -> None:
    once = ros_environment(wheels_prefix(tmp_path), {})

    assert ros_environment(tmp_path, once) == once


def test_environment_of_a_prefix_without_wheels_is_left_alone(tmp_path: Path) -> None:
    assert ros_environment(tmp_path, {"LD_LIBRARY_PATH": "/opt/ros/jazzy/lib"}) == {}


def test_rclpy_loads_without_a_second_interpreter_start() -> None:
    """The environment marks the wheels' library hook as done, so a wrong library path would fail the import."""
    inherited = {key: value for key, value in os.environ.items() if key not in ("LD_LIBRARY_PATH", "AMENT_PREFIX_PATH")}
    code = (
        "import rclpy, custom_msgs.msg as m; from rclpy.serialization import serialize_message as s; s(m.Heartbeat())"
    )

    result = subprocess.run(
        [sys.executable, "-c", code],
        env={**inherited, **ros_environment(base=inherited)},
        capture_output=True,
        text=True,
        check=False,
    )

    assert result.returncode == 0, result.stderr


def test_package_is_in_the_ament_index_with_its_configuration() -> None:
    index = PREFIX / "share/ament_index/resource_index"
    share = PREFIX / "share/robot_stack"

    assert (index / "packages/robot_stack").is_file()
    assert "custom_msgs" in (index / "package_run_dependencies/robot_stack").read_text().split(";")
    assert (share / "package.xml").is_file()
    assert (share / "config/robot.yaml").is_file()


def test_every_built_node_has_an_executable_and_no_other_has() -> None:
    launchers = list((PREFIX / "lib/robot_stack").iterdir())

    assert {path.name for path in launchers} == {process.name for process in available()}
    assert all(os.access(path, os.X_OK) for path in launchers)


def test_launcher_becomes_the_node_process(tmp_path: Path) -> None:
    """The process id stays, so signals of ros2 run and of a supervisor reach the node. Arguments pass through."""
    launcher = (PREFIX / "lib/robot_stack" / available()[0].name).read_text()
    probe = tmp_path / "probe"
    program = "import os, sys; print(os.getpid(), os.environ['LD_LIBRARY_PATH'], *sys.argv[1:])"
    probe.write_text(launcher.split("exec ")[0] + f'exec \'{sys.executable}\' -c "{program}" "$@"\n')
    probe.chmod(0o755)

    process = subprocess.Popen(
        [probe, "--ros-args", "a b"], stdout=subprocess.PIPE, text=True, env={"PATH": "/bin:/usr/bin"}
    )
    printed, _ = process.communicate(timeout=20)

    pid, libraries, *arguments = printed.strip().split(" ", 2)
    assert int(pid) == process.pid
    assert libraries == ros_environment(base={})["LD_LIBRARY_PATH"]
    assert arguments == ["--ros-args a b"]


def wheel_commands() -> Any:
    from custom_msgs.msg import SwerveModuleCommand, SwerveModuleCommandArray

    message = SwerveModuleCommandArray()
    message.header.frame_id = "base_link"
    message.modules = [
        SwerveModuleCommand(module_id=index, drive_velocity=0.25 * index, steering_angle=-0.5 * index)
        for index in range(4)
    ]
    return message


@pytest.mark.usefixtures("ros_domain")
def test_custom_message_travels_unchanged_and_with_the_locked_type_hash() -> None:
    """Peers compare the hash of the compiled type support on the wire, not the one in the share folder."""
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from custom_msgs.msg import SwerveModuleCommandArray
    from tf2_msgs.msg import TFMessage

    context = Context()
    rclpy.init(context=context)
    node = Node("probe", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    received: list[SwerveModuleCommandArray] = []
    node.create_subscription(SwerveModuleCommandArray, "wheels", received.append, 1)
    publisher = node.create_publisher(SwerveModuleCommandArray, "wheels", 1)
    node.create_publisher(TFMessage, "transforms", 1)
    try:
        wait_for(lambda: publisher.get_subscription_count() == 1, "the subscription")
        publisher.publish(wheel_commands())
        wait_for(lambda: executor.spin_once(timeout_sec=0.1) or received, "the message")
        wheels = wait_for(lambda: node.get_publishers_info_by_topic("wheels"), "the publisher in the graph")
        transforms = wait_for(lambda: node.get_publishers_info_by_topic("transforms"), "the publisher in the graph")

        assert received == [wheel_commands()]
        assert str(wheels[0].topic_type_hash) == locked(OWN_LOCK)["custom_msgs/msg/SwerveModuleCommandArray"]
        assert str(transforms[0].topic_type_hash) == locked(UPSTREAM_LOCK)["tf2_msgs/msg/TFMessage"]
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)
