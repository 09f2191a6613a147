"""Properties of nodes that need real processes: DDS, files, devices, signals, refusals. Others: simulated/nodes."""

from __future__ import annotations

import json
import os
import signal
import threading
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState

from custom_msgs.action import Dock
from custom_msgs.msg import EHMIState, SafetyStatus, SwerveModuleCommandArray
from robot_stack.contract import actions, topics
from robot_stack.contract.display import Display
from robot_stack.contract.frames import JOINTS
from robot_stack.core.point_cloud import points_from_xyz
from robot_stack.core.site_map import Grid, SiteMap, save_map
from robot_stack.docking.warm_up import warm_up
from robot_stack.middleware.point_cloud import cloud_message
from sim.computer.written_computer import WrittenComputer
from tests.simulated.nodes.test_aruco_detector import PICTURES, ids, image, info
from tests.support.blind import BLIND
from tests.support.engine import BUTTON_PRESSED, BUTTON_RELEASED, TestEngine
from tests.support.peer import Peer
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for
from tests.unit.localization.courtyard import cells


@pytest.mark.parametrize(
    ("name", "argument", "complaint"),
    [
        ("safety_monitor", "rows:=[TILT]", "ESTOP_PRESSED must be among the rows"),
        ("safety_monitor", "rows:=[ESTOP_PRESSED, NO_SUCH]", "NO_SUCH is not a fault of the contract"),
        ("safety_monitor", "expected_processes:=[nobody]", "nobody is not a process"),
        ("safety_monitor", "no_such:=1", "no_such: is not a known parameter"),
        ("emergency_stop_button", "debounce_s:=0.0", "debounce_s"),
        ("ndt_localization", "quality.odometry_silent_s:=0.05", "must be smaller than odometry_silent_s"),
        ("ndt_localization", "map:=nowhere", "no map 'nowhere'"),
        ("perception_pipeline", "crop.range_min_m:=100.0", "range_min_m must be smaller than range_max_m"),
    ],
)
def test_a_wrong_parameter_ends_the_start_with_one_line(start: Start, name: str, argument: str, complaint: str) -> None:
    process = start(name, "-p", argument)
    assert process.wait() == 2
    (error,) = [line for line in process.output().splitlines() if line.startswith("error: ")]
    assert complaint in error


def test_safety_monitor_starts_and_publishes_standstill_on_exit(start: Start, peer: Peer) -> None:
    """With an empty list, which ROS passes as no value, as `robot-stack up --only` sends it."""
    status, limit = peer.listen(topics.SAFETY_STATUS), peer.listen(topics.VELOCITY_LIMIT)
    monitor = start("safety_monitor", "-p", "rows:=[ESTOP_PRESSED]", "-p", "expected_processes:=[]")
    status.wait(lambda message: message.safety_state == "NORMAL", "NORMAL")
    limit.wait(lambda message: message.max_linear_velocity == 1.5, "the robot's own limit")
    leaves(monitor)
    assert limit.wait(lambda message: message.max_linear_velocity == 0.0, "a standstill").reason == "NODE_DEAD"


def leaves(process: NodeProcess, number: signal.Signals = signal.SIGTERM) -> None:
    process.signal(number)
    assert process.wait() == 0


def test_the_button_is_read_from_a_real_engine(start: Start, peer: Peer, tmp_path: Path) -> None:
    name, engine = "emergency_stop_button", TestEngine(start, tmp_path)
    sources = peer.listen(topics.EMERGENCY_STOP_SOURCES)
    engine.run().up()
    button = start(name)
    # A stalled engine counts as a press that ends by itself.
    sources.wait(lambda message: message.name == name and not message.pressed, "a report of no press")
    engine.set(input0=BUTTON_PRESSED)
    sources.wait(lambda message: message.pressed and message.pid == button.pid, "a report of the press")
    engine.set(input0=BUTTON_RELEASED)
    sources.wait(lambda message: not message.pressed, "a report of the release")
    leaves(button)
    engine.close()


def test_swerve_controller_commands_standstill_and_refuses_a_second_one(start: Start, peer: Peer) -> None:
    def is_zero(message: SwerveModuleCommandArray) -> bool:
        return all(module.drive_velocity == 0.0 for module in message.modules)

    commands = peer.listen(topics.WHEEL_COMMANDS)
    node = start("swerve_controller")
    peer.repeat(topics.JOINT_STATES, lambda: JointState(name=list(JOINTS), position=[0.0] * 8), 50.0)
    commands.wait(is_zero, "wheel commands")
    second = start("swerve_controller")
    assert second.wait() == 2
    assert "swerve_controller is already running" in second.output()
    leaves(node)
    assert is_zero(commands.last)


def test_docking_controller_answers_a_goal_over_dds(start: Start, peer: Peer) -> None:
    passenger = peer.listen(topics.PASSENGER_ATTACHED)
    client = ActionClient(peer.node, Dock, actions.DOCK.name)
    start("sim_world")
    start("swerve_hardware_interface")  # starts the engine's bus, which reading an input requires
    process = start("docking_controller")
    passenger.wait(lambda message: not message.data, "the passenger's state, once the latch can be read")
    wait_for(client.server_is_ready, "the action")
    sent = peer.in_loop(lambda: client.send_goal_async(Dock.Goal(dock_id="nowhere")))
    wait_for(sent.done, "an answer to the goal")
    result = peer.in_loop(sent.result().get_result_async)
    wait_for(result.done, "the result")
    assert result.result().result.error_code == Dock.Result.UNKNOWN_DOCK
    leaves(process)


def test_ehmi_bridge_reaches_the_display_over_a_terminal_that_goes_with_it(start: Start, peer: Peer) -> None:
    shown, status = peer.listen(topics.SIM_EHMI_DISPLAY), peer.listen(topics.EHMI_STATUS)
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 20.0)
    display, bridge = start("ehmi_display"), start("ehmi_bridge", "-p", "port:=ehmi_display")

    def shows(state: Display) -> dict[str, Any]:
        message = shown.wait(lambda message: json.loads(message.data)["state"] == state, f"{state.name} shown")
        return dict(json.loads(message.data))

    peer.publish(topics.EHMI_STATE_COMMAND, EHMIState(state_num=Display.TRANSPORT, language="zh", volume=9))
    reported = shows(Display.TRANSPORT)
    assert (reported["text"], reported["volume"], reported["colour"]) == ("载客自动行驶中", 9, "turquoise")
    status.wait(lambda message: message.linked and message.acknowledged_state == Display.TRANSPORT, "acknowledged")
    leaves(bridge)
    shows(Display.OFF)
    link = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"]) / "ehmi_display"
    assert link.is_symlink()
    leaves(display)
    assert not link.is_symlink()


@pytest.fixture
def computer(tmp_path: Path) -> Iterator[WrittenComputer]:
    """A computer whose time advances by itself."""
    written, ended = WrittenComputer(tmp_path / "computer"), threading.Event()

    def live() -> None:
        while not ended.wait(0.02):
            written.tick()

    thread = threading.Thread(target=live)
    thread.start()
    yield written
    ended.set()
    thread.join()


def test_system_monitor_reads_the_kernels_files_its_own_process_and_the_graph(
    start: Start, peer: Peer, computer: WrittenComputer
) -> None:
    status, tree = peer.listen(topics.ROBOT_STATUS), peer.listen(topics.DIAGNOSTICS_AGG)
    temperature = peer.listen(topics.COMPUTER_TEMPERATURE)
    names = {"proc_folder": computer.proc, "thermal_folder": computer.thermal}
    given = [f"{name}:={value}" for name, value in (*names.items(), ("graph_period_s", 0.5), ("pss_period_s", 0.5))]
    process = start("system_monitor", *(word for item in given for word in ("-p", item)))

    def wait_entry(name: str, condition: Callable[[dict[str, str]], bool]) -> None:
        def fits(entry: DiagnosticStatus) -> bool:
            return entry.name == f"/Robot/System/system_monitor: {name}" and condition(
                {item.key: item.value for item in entry.values}
            )

        tree.wait(lambda message: any(map(fits, message.status)), f"an entry {name} that fits")

    status.wait(lambda m: m.memory_usage_percent == pytest.approx(40.0, abs=0.5), "the memory")
    status.wait(lambda m: 0.0 < m.disk_usage_percent <= 100.0, "the disk")
    zone = temperature.wait(lambda m: m.temperature == pytest.approx(50.0), "the temperature")
    assert zone.header.frame_id == "thermal_zone0 x86_pkg_temp"
    wait_entry("computer", lambda values: "50.0 C" in values["temperature"] and values["pressure io"] == "1.5 %")
    wait_entry("processes", lambda values: "pss" in values.get("system_monitor", ""))
    drivers = [Peer("xsens_driver"), Peer("xsens_driver")]
    wait_entry("graph", lambda values: values.get("xsens_driver") == "two nodes of this name")
    for driver in drivers:
        driver.close()
    leaves(process)


def test_navigation_controller_stands_with_an_empty_plan(start: Start, peer: Peer) -> None:
    node = start("navigation_controller", *BLIND)
    commands = peer.listen(topics.CMD_VEL)
    commands.wait(lambda message: message == Twist(), "a zero command")
    late = peer.listen(topics.PLAN)  # latched for later subscribers
    assert late.wait(lambda message: not message.poses, "the empty plan").header.frame_id == "map"
    leaves(node)
    assert all(message == Twist() for message in commands.messages)


def test_localization_loads_a_map_and_refuses_a_damaged_one(start: Start, tmp_path: Path) -> None:
    folder = tmp_path / "courtyard"
    save_map(SiteMap("courtyard", cells(), Grid(1.0, -8.0, -6.0, np.zeros((14, 20), np.int8))), folder)
    node = start("ndt_localization", "-p", f"map:={folder}")
    node.wait_output("cells of 0.5 m")
    leaves(node)
    (folder / "grid.pgm").write_bytes(b"P5\n1 1\n255\n0")
    damaged = start("ndt_localization", "-p", f"map:={folder}")
    assert damaged.wait() == 2
    assert "grid.pgm is missing or differs from the file" in damaged.output()


def test_markers_of_an_image_come_over_dds(start: Start, peer: Peer) -> None:
    warm_up()  # the first compilation on a machine takes longer than the test's timeout
    arrays, clock = peer.listen(topics.ARUCO_DETECTIONS), peer.node.get_clock()
    node = start("aruco_detector", "-p", "always_on:=true")
    peer.repeat(topics.FRONT_CAMERA_INFO, info, 10.0)
    peer.repeat(topics.FRONT_IMAGE, lambda: image("front", PICTURES["front"], 1e-9 * clock.now().nanoseconds), 10.0)
    arrays.wait(lambda message: ids(message) == [0, 1, 2, 3], "the front camera's markers")
    leaves(node)


def test_full_costmap_is_transmitted_over_dds(start: Start, peer: Peer) -> None:
    node, clock = start("costmap_server"), peer.node.get_clock()

    def space() -> OccupancyGrid:
        message = OccupancyGrid(data=array("b", bytes(40000)))
        message.header.frame_id, message.header.stamp = "odom", clock.now().to_msg()
        message.info.resolution = 0.05
        message.info.height = message.info.width = 200
        message.info.origin.orientation.w = 1.0
        return message

    peer.repeat(topics.SPACE, space, 5.0)
    peer.repeat(topics.OBSTACLES, lambda: cloud_message(points_from_xyz(np.empty((0, 3))), "base_link"), 20.0)
    peer.listen(topics.LOCAL_COSTMAP).wait(lambda message: len(message.data) == 40000, "a grid")
    leaves(node)
