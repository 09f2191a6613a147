"""``simulate --from``: the state at a moment of a recording, and what the run cannot take from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped, Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PlanPath
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool

from custom_msgs.msg import DockingStatus, MissionOrder, MissionQueue, MissionStatus
from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import ConfigError
from robot_stack.core.geometry import Pose2
from robot_stack.core.kept_events import EventRecord, EventState, Software, Trigger, write_record
from robot_stack.core.mission import Kind
from robot_stack.core.mission_library import mission_library
from robot_stack.middleware.conversions import pose_to_msg, quaternion_to_msg
from robot_stack.mission.journal import SqliteJournal, journal_path
from robot_stack.mission.record import restored
from robot_stack.mission.states import State
from robot_stack.recording.writer import BagWriter, topic_info
from robot_stack.ros.serialization import serialize_message
from sim.scheduler.observers import Recording
from sim.settings import world_settings
from sim.stack.moment import RecordedMoment, moment_in, parse_moment, read_moment
from sim.stack.recording import RUN_FILE, run_file
from tf2_msgs.msg import TFMessage

SECOND = 1_000_000_000
BEGIN_S = 100
HERE = Pose2(1.0, 2.0, 0.5)
Items = list[tuple[float, Topic, Any]]


def truth(pose: Pose2) -> Odometry:
    message = Odometry()
    message.pose.pose = pose_to_msg(pose)
    return message


def estimate(pose: Pose2) -> PoseStamped:
    return PoseStamped(pose=pose_to_msg(pose))


def mission(**changes: Any) -> MissionStatus:
    """On the way to the second of three waypoints of ``short_hop``."""
    values = {"state": "RUNNING", "mission_id": "short_hop", "current_waypoint": "stop", "waypoints_completed": 1}
    return MissionStatus(**(values | {"total_waypoints": 3} | changes))


def bodies(**poses: Pose2) -> TFMessage:
    transforms = [
        TransformStamped(
            child_frame_id=name,
            transform=Transform(translation=Vector3(x=pose.x, y=pose.y), rotation=quaternion_to_msg(pose.yaw)),
        )
        for name, pose in poses.items()
    ]
    return TFMessage(transforms=transforms)


@pytest.fixture
def record(tmp_path: Path) -> Callable[..., Path]:
    def write(*items: tuple[float, Topic, Any], **parameters: Any) -> Path:
        rows = list(dict.fromkeys(row for _, row, _ in items))
        attachments = {RUN_FILE: run_file(7, {"sim_world": parameters})} if parameters else {}
        folder = tmp_path / "recording"
        bag = BagWriter(folder, [topic_info(row) for row in rows], Recording.FORMAT, attachments)
        for at_s, row, message in items:
            at_ns = round((BEGIN_S + at_s) * SECOND)
            bag.write(row.name, at_ns, at_ns, bytes(serialize_message(message)))
        bag.close()
        return folder

    return write


def moment(path: Path, at_s: float | None = None) -> RecordedMoment:
    return moment_in(*read_moment(path, at_s))


def test_the_newest_messages_of_the_moment_are_the_start(record) -> None:
    path = record(
        (0.0, topics.SIM_GROUND_TRUTH, truth(Pose2(0.0, 0.0, 0.0))),
        (2.0, topics.SIM_GROUND_TRUTH, truth(HERE)),
        (2.0, topics.CURRENT_POSE, estimate(Pose2(1.1, 2.0, 0.5))),
        (2.0, topics.BATTERY_STATE, BatteryState(percentage=0.25)),
        (2.0, topics.PASSENGER_ATTACHED, Bool(data=True)),
        (5.0, topics.SIM_GROUND_TRUTH, truth(Pose2(9.0, 9.0, 0.0))),
        world="flat",
        passenger_mass_kg=90.0,
        start_x_m=3.0,
    )
    found = moment(path, 3.0)
    assert (found.pose.x, found.pose.y, found.pose.yaw) == pytest.approx((1.0, 2.0, 0.5))
    assert (found.charge, found.attached, found.record) == (0.25, True, None)
    scenario = found.scenario(None, None)
    assert (scenario.world, scenario.seed, scenario.passenger_mass_kg) == ("flat", 7, 90.0)
    assert scenario.start is not None
    assert scenario.estimated_start is not None
    assert (scenario.start.x_m, scenario.estimated_start.x_m) == pytest.approx((1.0, 1.1))
    assert not [item for item in scenario.settings if "start" in item or "passenger" in item]
    assert found.scenario(3, "yard").seed == 3
    assert found.scenario(3, "yard").world == "yard"


def test_another_world_has_its_own_map_in_every_node(record) -> None:
    found = moment(record((0.5, topics.CURRENT_POSE, estimate(HERE)), world="flat"))
    names = [item.partition("=")[0].partition(".") for item in world_settings("flat")]
    recorded = {node: {"other": 1, name: "of the recording"} for node, _, name in names}
    settings = replace(found, parameters=recorded).scenario(3, "yard").settings
    assert [item for item in settings if "of the recording" in item] == []
    assert "mission_manager.other=1" in settings


def test_what_is_not_recorded_is_listed(record) -> None:
    found = moment(record((0.5, topics.CURRENT_POSE, estimate(HERE))))
    assert found.at_s == 1.0
    text = "\n".join(found.lines())
    for missing in ("true pose", "people", "battery", "the mission", "wheelchair is attached", "names none", "rest"):
        assert f"not as recorded: {missing}" in text or missing in text, missing
    assert "as recorded: robot at x 1.00 m, y 2.00 m, 29 deg, as the localization had it" in text


def test_the_mission_is_journaled_with_its_progress(record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order = MissionOrder(id="visit", mission_id="short_hop", origin="cli", priority=200, state=MissionOrder.UNDER_WAY)
    waiting = MissionOrder(id="later", mission_id="yard_tour", origin="cli")
    path = record(
        (0.0, topics.CURRENT_POSE, estimate(HERE)),
        (0.1, topics.MISSION_QUEUE, MissionQueue(current=[order], orders=[waiting])),
        (0.2, topics.MISSION_STATUS, mission()),
    )
    found = moment(path)
    assert found.resumes
    assert found.scenario(None, None).mission == "short_hop"
    assert any("1 waiting orders" in line for line in found.left_out)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    found.write_journal()
    journal = SqliteJournal(journal_path())
    loaded = restored(journal.load())
    journal.close()
    assert (loaded.state, loaded.waypoint, loaded.homeward) == (State.PAUSED, 1, False)
    assert loaded.queue.current is not None
    assert (loaded.queue.current.id, loaded.queue.current.priority) == ("visit", 200)


@pytest.mark.parametrize(
    ("status", "homeward", "resumes"),
    [
        (mission(state="PAUSED"), False, False),
        (mission(state="WAITING"), False, True),
        (mission(current_waypoint="home", waypoints_completed=3, total_waypoints=4), True, True),
    ],
)
def test_states_of_a_mission(record, status: MissionStatus, homeward: bool, resumes: bool) -> None:
    found = moment(record((0.0, topics.CURRENT_POSE, estimate(HERE)), (0.0, topics.MISSION_STATUS, status)))
    assert found.record is not None
    assert (found.record.homeward, found.resumes) == (homeward, resumes)
    assert not found.record.docking_begun
    assert found.record.state is (State.RUNNING if resumes else State.PAUSED)


def test_a_docking_under_way_begins_again_where_the_robot_stands(record) -> None:
    known = mission_library().find("short_transport")
    index = next(number for number, stop in enumerate(known.waypoints) if stop.action.kind is Kind.DOCK)
    route = {"current_waypoint": known.waypoints[index].name, "total_waypoints": len(known.waypoints)}
    path = record(
        (0.0, topics.CURRENT_POSE, estimate(HERE)),
        (0.0, topics.MISSION_STATUS, mission(mission_id=known.id, waypoints_completed=index, **route)),
        (0.0, topics.DOCKING_STATUS, DockingStatus(state="SERVOING")),
    )
    found = moment(path)
    assert found.record is not None
    assert found.record.docking_begun


@pytest.mark.parametrize(
    ("status", "problem"),
    [
        (mission(mission_id="gone"), "there is no mission 'gone'"),
        (mission(total_waypoints=9), "the recorded route has 9 waypoints and the mission file 3"),
    ],
)
def test_a_mission_that_cannot_be_taken_up_is_named(record, status: MissionStatus, problem: str) -> None:
    found = moment(record((0.0, topics.CURRENT_POSE, estimate(HERE)), (0.0, topics.MISSION_STATUS, status)))
    assert found.record is None
    assert any(problem in line for line in found.left_out)


@pytest.mark.parametrize("planned", [True, False])
def test_a_goal_is_taken_up_while_there_is_a_plan_to_it(record, planned: bool) -> None:
    goal = estimate(Pose2(4.0, 0.0, 0.0))
    goal.header.frame_id = "map"
    path = record(
        (0.0, topics.CURRENT_POSE, estimate(HERE)),
        (0.0, topics.GOAL_POSE, goal),
        (0.0, topics.PLAN, PlanPath(poses=[goal] if planned else [])),
    )
    assert [item.x_m for item in moment(path).scenario(None, None).goals] == ([4.0] if planned else [])


def test_wheelchair_and_people_are_placed_as_the_bodies_were(record) -> None:
    chair, anna = Pose2(3.0, 4.0, 0.0), Pose2(2.0, 0.0, 0.0)
    path = record(
        (0.0, topics.SIM_GROUND_TRUTH, truth(HERE)),
        (0.0, topics.SIM_BODIES, bodies(base_link=HERE, wheelchair=chair, person_anna=anna)),
    )
    found = moment(path)
    assert set(found.people) == {"person_anna"}
    assert "sim_world.wheelchair_x_m=3.0" in found.scenario(None, None).settings


def test_an_event_begins_before_its_first_trigger(record) -> None:
    path = record(*((float(at_s), topics.CURRENT_POSE, estimate(HERE)) for at_s in range(30)))
    trigger = Trigger(at_s=0.0, ros_s=BEGIN_S + 25.0, reasons=("TILT",))
    software = Software(version="1", sha256="")
    event = EventRecord(
        id="event", state=EventState.COMPLETE, triggers=(trigger,), software=software, map=None, nodes=()
    )
    write_record(path, event)
    assert moment(path).at_s == 15.0


def test_without_a_pose_there_is_no_start(record) -> None:
    path = record((0.0, topics.BATTERY_STATE, BatteryState()), (4.0, topics.CURRENT_POSE, estimate(HERE)))
    with pytest.raises(ConfigError, match="no pose of the robot within 2 s"):
        moment(path, 2.0)


def test_file_and_seconds(tmp_path: Path) -> None:
    assert parse_moment("ride.mcap@12.5") == (Path("ride.mcap"), 12.5)
    assert parse_moment("ride.mcap") == (Path("ride.mcap"), None)
    odd = tmp_path / "ride@12"
    odd.mkdir()
    assert parse_moment(str(odd)) == (odd, None)
    with pytest.raises(ConfigError, match=r"--from .* cannot be read"):
        read_moment(tmp_path / "gone.mcap", 1.0)
    for wrong in ("ride.mcap@x", "ride.mcap@-1", "ride.mcap@inf"):
        with pytest.raises(ConfigError, match="seconds since the recording's begin"):
            parse_moment(wrong)
