"""The process sim_world: its topics, its engine, its faults, its shutdown."""

from __future__ import annotations

import signal
import time
from typing import Any

import numpy as np
import pytest

from custom_msgs.srv import InjectFault
from robot_stack.contract import services, topics
from robot_stack.contract.frames import DRIVE_AXES, JOINTS
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.middleware.conversions import time_to_s
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.api.values import Profile, Velocity_VelCommand
from robot_stack.wmx.robot_parameters import robot_parameters, write_parameters
from sim.worldfile import load_world
from tests.support.peer import Peer, says
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for
from tf2_msgs.msg import TFMessage

ROBOT = load_robot()


def option(**values: object) -> list[str]:
    """Parameters of node sim_world only: other nodes of its process refuse unknown parameters."""
    return [part for name, value in values.items() for part in ("-p", f"sim_world:{name}:={value}")]


def inject(
    peer: Peer, kind: str, target: str = "", value: float = 0.0, duration_s: float = 0.0
) -> InjectFault.Response:
    request = InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s)
    return peer.call(services.INJECT_FAULT, request)


def drive_on(engine: MotionEngine, speed_mps: float) -> None:
    """Starts the bus, sets the robot's parameters, switches the servos on and turns all wheels at a speed."""
    assert engine.api.StartCommunication(60000) == 0
    assert engine.core_motion.config.ImportAndSetAll(write_parameters(robot_parameters(ROBOT))) == 0
    for axis in range(8):
        assert engine.core_motion.axisControl.SetServoOn(axis, 1) == 0
    wait_for(lambda: engine.read_status()[1].servo_on.all(), "servos on")
    profile = Profile.SetupTrapezoidal(speed_mps / ROBOT.wheel_radius_m, 12.0, 12.0)
    assert engine.core_motion.velocity.StartVel(4, [Velocity_VelCommand(axis, profile) for axis in DRIVE_AXES]) == 0


@pytest.fixture(scope="module")
def world(shared_start: Start) -> NodeProcess:
    return shared_start("sim_world", *option(world="flat"))


@pytest.fixture(scope="module")
def listener(shared_peer: Peer, world: NodeProcess) -> Peer:
    return shared_peer


def test_contents_of_the_topics_and_their_stamps(listener: Peer) -> None:
    """Their rates: tests/simulated/test_graph.py."""
    truth, diagnostics = listener.listen(topics.SIM_GROUND_TRUTH), listener.listen(topics.DIAGNOSTICS)
    joints, battery = listener.listen(topics.SIM_JOINT_STATES), listener.listen(topics.BATTERY_STATE)
    mounting, clock = listener.listen(topics.TF_STATIC), listener.listen(topics.CLOCK)
    imu = listener.listen(topics.IMU)
    for received in (imu, truth, joints, battery):
        wait_for(lambda received=received: received.items, "messages")
    assert imu.last.header.frame_id == "imu"
    assert imu.last.linear_acceleration.z == pytest.approx(9.81, abs=0.3)
    assert abs(time_to_s(imu.last.header.stamp) - time.time()) < 30.0, "those of the system clock"
    assert (truth.last.header.frame_id, truth.last.child_frame_id) == ("map", "base_link")
    assert list(joints.last.name) == list(JOINTS)
    assert battery.last.present
    assert 40.0 < battery.last.voltage < 56.0
    transform = mounting.wait(lambda message: message.transforms, "mounting").transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "imu")

    def values(message: Any) -> dict[str, str]:
        return {item.key: item.value for item in message.status[0].values}

    seen = diagnostics.wait(lambda message: "sim_speed" in values(message), "the pace")
    assert {"overruns", "dropped_s", "worst_lag_ms"} <= values(seen).keys()
    assert clock.items == [], "at real time the system clock is the clock"


def test_the_engine_moves_the_robot_and_the_drives_stop_it_when_the_engine_stalls(listener: Peer) -> None:
    truth = listener.listen(topics.SIM_GROUND_TRUTH)
    truth.wait(lambda message: True, "ground truth")
    with connect("test") as engine:
        drive_on(engine, 0.5)
        truth.wait(lambda message: message.twist.twist.linear.x > 0.45, "the robot drives")
        assert inject(listener, "engine_stall").success
        truth.wait(lambda message: abs(message.twist.twist.linear.x) < 0.01, "the drives stopped by themselves")
        assert "engine_stall" in inject(listener, "clear").message


def test_the_estop_bit_reaches_the_engines_clients(listener: Peer) -> None:
    byte, bit = ROBOT.estop_input_byte, ROBOT.estop_input_bit
    with connect("test") as engine:
        assert engine.api.StartCommunication(60000) == 0
        wait_for(lambda: engine.read_status()[1].input_bit(byte, bit), "a released button")
        assert inject(listener, "estop_button", value=1.0).message == "emergency stop button pressed"
        wait_for(lambda: not engine.read_status()[1].input_bit(byte, bit), "a pressed button")


def test_faults_are_answered_and_a_silent_imu_is_reported_by_its_driver(listener: Peer) -> None:
    imu, diagnostics = listener.listen(topics.IMU), listener.listen(topics.DIAGNOSTICS)
    imu.wait(lambda message: True, "samples")
    unknown = inject(listener, "meteor")
    assert not unknown.success
    assert unknown.message.startswith("no fault 'meteor'; there are drive_alarm")
    assert not inject(listener, "drive_alarm", "fl_wheel").success
    assert inject(listener, "imu_silent").success
    says(diagnostics, "imu_driver", "sends nothing")
    count = len(imu.items)
    says(diagnostics, "imu_driver", "sends nothing")
    assert len(imu.items) == count
    assert "imu_silent" in inject(listener, "clear").message


def test_a_second_world_is_refused(world: NodeProcess, listener: Peer, shared_start: Start) -> None:
    listener.listen(topics.SIM_GROUND_TRUTH).wait(lambda message: True, "ground truth")
    second = shared_start("sim_world")
    assert second.wait() == 2
    assert "already running" in second.output()
    assert world.running()


def test_simulated_clock_keeps_its_step_at_other_speeds(start: Start, peer: Peer) -> None:
    start("sim_world", *option(world="flat"), *option(speed=3.0), *option(use_sim_time=True))
    clock, truth = peer.listen(topics.CLOCK), peer.listen(topics.SIM_GROUND_TRUTH)
    wait_for(lambda: len(clock.items) > 500, "five seconds of simulated time")
    steps = np.diff([time_to_s(message.clock) for message in clock.messages])
    assert np.median(steps) == pytest.approx(0.01, abs=1e-6), "100 Hz of simulated time"
    wait_for(
        lambda: truth.items and abs(time_to_s(truth.last.header.stamp) - time_to_s(clock.last.clock)) < 0.2,
        "a truth that is stamped by the clock",
    )


def places(message: TFMessage) -> dict[str, tuple[float, float, float]]:
    """Position of each body in map, m."""
    found = {}
    for body in message.transforms:
        assert body.header.frame_id == "map"
        place = body.transform.translation
        found[body.child_frame_id] = (place.x, place.y, place.z)
    return found


def test_bodies_are_robot_chair_stations_and_people_with_the_stamp_of_the_truth(start: Start, peer: Peer) -> None:
    chair = {"wheelchair_x_m": 3.0, "wheelchair_y_m": -1.0, "wheelchair_yaw_rad": 0.5}
    start("sim_world", *option(world="yard", **chair))
    truth, bodies = peer.listen(topics.SIM_GROUND_TRUTH), peer.listen(topics.SIM_BODIES)
    people = [f"person_{person.name}" for person in load_world("yard").people]
    seen = bodies.wait(lambda message: len(message.transforms) == 3 + len(people), "every body", 60.0)
    found = places(seen)
    assert list(found) == ["base_link", "wheelchair", "charger", *people]
    assert len(people) > 3
    assert found["wheelchair"] == pytest.approx((3.0, -1.0, 0.0), abs=1e-3)
    assert found["charger"] == pytest.approx((-3.45, 0.0, 0.0), abs=1e-9)
    turn = seen.transforms[1].transform.rotation
    assert 2.0 * np.arctan2(turn.z, turn.w) == pytest.approx(0.5, abs=1e-3)
    truth.wait(lambda _: True, "ground truth")
    for received in (truth, bodies):  # of the time in which both are discovered
        received.items.clear()
    wait_for(lambda: len(bodies.items) > 20, "bodies")
    stamps = {time_to_s(message.header.stamp) for message in truth.messages}
    mine = [{time_to_s(body.header.stamp) for body in message.transforms} for message in bodies.messages]
    assert all(len(each) == 1 for each in mine)
    shared = sum(each <= stamps for each in mine)
    assert shared > 0.8 * len(mine), "the same moment as the ground truth's, lost messages apart"
    # A late world catches up in bursts, so the test compares message counts with the truth's instead of gaps.
    assert len(mine) > 0.7 * len(truth.messages)


def test_start_pose_and_chair_are_parameters(start: Start, peer: Peer) -> None:
    options = {"world": "flat", "start_x_m": 2.0, "start_y_m": -1.0, "start_yaw_rad": 1.5, "attached_at_start": "true"}
    start("sim_world", *option(**options))
    truth, bodies = peer.listen(topics.SIM_GROUND_TRUTH), peer.listen(topics.SIM_BODIES)
    chair = bodies.wait(lambda message: "wheelchair" in places(message), "the wheelchair").transforms[1].transform
    ahead = load_docks().docks["chair_1"].dock_pose.pose().inverse()
    hanging = Pose2(2.0, -1.0, 1.5).compose(ahead)
    assert (chair.translation.x, chair.translation.y) == pytest.approx((hanging.x, hanging.y), abs=0.01)
    pose = truth.wait(lambda message: True, "ground truth").pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((2.0, -1.0), abs=0.01)
    assert 2.0 * np.arctan2(pose.orientation.z, pose.orientation.w) == pytest.approx(1.5, abs=0.01)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("world:=moon", "no world 'moon'"),
        ("wheelchair_x_m:=1.0", "are given together or not at all"),
        ("wrold:=flat", "wrold: is not a known parameter"),
        ("passenger_mass_kg:=500.0", "passenger_mass_kg must be in 0..120"),
    ],
)
def test_wrong_parameters_are_one_clear_line(start: Start, setting: str, message: str) -> None:
    process = start("sim_world", "-p", f"sim_world:{setting}")
    assert process.wait() == 2
    errors = [line for line in process.output().splitlines() if line.startswith("error:")]
    assert len(errors) == 1
    assert message in errors[0]


def test_a_signal_ends_it_and_leaves_nothing(start: Start, peer: Peer) -> None:
    world = start("sim_world", *option(world="flat"))
    peer.listen(topics.SIM_GROUND_TRUTH).wait(lambda message: True, "ground truth")
    socket = runtime_dir() / "engine.sock"
    assert socket.exists()
    world.signal(signal.SIGTERM)
    assert world.wait() == 0
    assert not socket.exists()
    assert "Traceback" not in world.output()
