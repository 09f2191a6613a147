"""The mission manager with fake drives, a fake safety monitor and a fake navigation controller."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool

from custom_msgs.msg import LatchStatus, MissionOrder, MissionQueue, RobotStatus, SafetyStatus, UICommand
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.contract.display import Display
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.states import State
from sim.scheduler.process import Process
from tests.simulated.bench import Bench
from tests.simulated.nodes.navigation import FakeNavigation

MISSION = """
id: ride
name: {en: Ride, ja: 走行, zh: 行驶}
home: {x: 0.0, y: 0.0, yaw: 0.0}
waypoints:
  - {name: first, x: 2.0, y: 0.0, yaw: 0.0, action: pass}
  - {name: second, x: 4.0, y: 1.0, yaw: 0.5, action: {wait: 0.5}}
  - {name: last, x: 4.0, y: 3.0, yaw: 0.0, action: park}
"""
DOCKING = MISSION.replace("id: ride", "id: docking").replace("{wait: 0.5}", "{dock: chair_9}")
MALFORMED = MISSION.replace("x: 4.0, y: 1.0", "x: .nan, y: 1.0").replace("id: ride", "id: malformed")


class World:
    """The surroundings of the mission manager; tests set the robot's pose."""

    def __init__(self, bench: Bench, folder: Path) -> None:
        self.bench, self.folder = bench, folder
        self.missions = folder / "missions"
        self.missions.mkdir()
        for name, text in (("ride", MISSION), ("docking", DOCKING), ("malformed", MALFORMED)):
            (self.missions / f"{name}.yaml").write_text(text, encoding="utf-8")
        self.journal = folder / "state" / "mission.db"
        self.pose = Pose2(0.0, 0.0, 0.0)
        self.safety = SafetyStatus(safety_state="NORMAL")
        self.charge = 0.8
        self.supply = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
        self.status, self.goal_poses = bench.listen(topics.MISSION_STATUS), bench.listen(topics.GOAL_POSE)
        self.navigation = FakeNavigation(bench)
        self.stops, self.display = bench.listen(topics.EMERGENCY_STOP), bench.listen(topics.EHMI_STATE_COMMAND)
        for row in (topics.UI_COMMAND, topics.EMERGENCY_STOP):
            bench.publisher(row)
        self.know_pose()
        bench.repeat(topics.ODOM, Odometry, 50.0)
        bench.repeat(topics.SAFETY_STATUS, lambda: self.safety, 20.0)
        bench.repeat(topics.BATTERY_STATE, self._battery, 5.0)
        self.node: Process | None = None

    def know_pose(self) -> None:
        self.bench.repeat(topics.CURRENT_POSE, lambda: pose_stamped(self.pose, "map", self.bench.stamp()), 20.0)

    def _battery(self) -> BatteryState:
        return BatteryState(percentage=self.charge, power_supply_status=self.supply)

    def launch(self, **overrides: Any) -> Process:
        """Starts a new process or restarts one that has ended, and waits until it has received all topics."""
        if self.node is None:
            given = {"missions_folder": str(self.missions), "journal_file": str(self.journal), **overrides}
            self.node = self.bench.start("mission_manager", given)
        else:
            self.bench.start_again(self.node)
        self.bench.run(1.0)
        return self.node

    def command(self, name: str, mission_id: str = "") -> Any:
        """Sends a command and returns the status with its answer."""
        if self.status.last is not None and self.status.last.last_command == name:
            self.command(f"{name} AGAIN")  # an unknown command, so that the next answer differs from the last one
        begun_s = self.bench.now_s
        self.bench.publish(topics.UI_COMMAND, UICommand(command_type=name, mission_id=mission_id))

        def answer() -> Any:
            return next((one for one in self.status.since(begun_s) if one.last_command == name), None)

        return self.bench.wait(answer, f"an answer to {name}", 1.0)

    def safety_says(self, state: str, *faults: str) -> None:
        """Sets the safety monitor's state, and returns when it has been received."""
        self.safety = SafetyStatus(safety_state=state, active_faults=faults)
        self.bench.run(0.2)

    def state(self, state: str, waypoint: str | None = None) -> Any:
        return self.status.wait(
            lambda s: s.state == state and waypoint in (None, s.current_waypoint), f"{state} {waypoint or ''}"
        )

    def goal(self, x: float) -> PoseStamped:
        """Waits until navigation has the goal."""

        def found() -> Any:
            goal = self.navigation.goal
            return goal is not None and goal.request.pose.pose.position.x == x and goal

        pose: PoseStamped = self.bench.wait(found, f"goal {x}").request.pose
        assert pose.header.frame_id == "map"
        return pose

    def no_goal(self) -> None:
        """Waits until the goals of this node and all others are cancelled."""
        self.bench.wait(lambda: self.navigation.goal is None, "the goal cancelled", 1.0)
        self.goal_poses.wait(lambda goal: goal.header.frame_id == "", "the goals of others cancelled", 1.0)

    def kill(self) -> None:
        assert self.node is not None
        self.node.kill()


@pytest.fixture
def world(bench: Bench, tmp_path: Path) -> World:
    return World(bench, tmp_path)


def test_a_ride_from_start_to_end(world):
    world.launch()
    assert world.state("IDLE").mission_id == ""
    status = world.command("START_MISSION", "ride")
    assert status.last_command_accepted, status.reason
    assert (status.state, status.mission_id, status.mission_name) == ("RUNNING", "ride", "走行")
    world.goal(2.0)
    world.pose = Pose2(1.7, 0.0, 0.0)
    goal = world.goal(4.0)
    assert pose_from_msg(goal.pose) == Pose2(4.0, 1.0, pytest.approx(0.5))
    assert world.navigation.ended == ["aborted"], "preempted, without a cancellation, which would stop the robot"
    world.pose = Pose2(4.0, 1.0, 0.5)
    world.state("WAITING", "second")
    world.state("RUNNING", "last")
    world.pose = Pose2(4.0, 3.0, 0.0)
    done = world.state("COMPLETED")
    assert (done.waypoints_completed, done.total_waypoints, done.progress) == (3, 3, 1.0)
    world.no_goal()
    shown = [message.state_num for message in world.display.messages]
    assert shown[0] in (Display.OFF, Display.IDLE)
    assert Display.NAVIGATING in shown
    world.display.wait(lambda message: message.state_num == Display.IDLE, "idle on the display")
    assert world.display.last.language == "ja"


def shows(world, display: Display) -> None:
    world.display.wait(lambda message: message.state_num == display, f"{display.name} on the display")


def test_a_mission_made_on_this_robot_is_driven_at_once(world):
    own = world.folder / "own"
    world.launch(own_missions_folder=str(own))
    assert "there is no mission" in world.command("START_MISSION", "made_here").reason
    own.mkdir()
    (own / "made_here.yaml").write_text(MISSION.replace("id: ride", "id: made_here"), encoding="utf-8")
    status = world.command("START_MISSION", "made_here")
    assert status.last_command_accepted, status.reason
    assert status.mission_id == "made_here"


def test_display_shows_manual_driving_charging_and_their_end(world):
    world.launch()
    shows(world, Display.IDLE)
    world.supply = BatteryState.POWER_SUPPLY_STATUS_CHARGING
    shows(world, Display.CHARGING)
    world.supply = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    shows(world, Display.IDLE)
    world.bench.repeat(topics.TELEOP_CMD_VEL, TwistStamped, 20.0)
    shows(world, Display.MANUAL)
    world.bench.silence(topics.TELEOP_CMD_VEL)
    shows(world, Display.IDLE)
    assert world.bench.stop(world.node) == 0
    shows(world, Display.OFF)


@pytest.mark.parametrize(
    ("command", "mission_id", "why"),
    [
        ("START_MISSION", "nowhere", "there is no mission 'nowhere'; known: docking, malformed, ride"),
        ("START_MISSION", "docking", "waypoint 'second' of 'docking': there is no dock 'chair_9'; known: "),
        ("START_MISSION", "malformed", "malformed.yaml: waypoint 2 'second': x: Input should be a finite number"),
        ("RESUME", "", "RESUME refused"),
        ("LAUNCH", "", "unknown command"),
    ],
)
def test_refusals(world, command, mission_id, why):
    world.launch()
    answer = world.command(command, mission_id)
    assert not answer.last_command_accepted
    assert why in answer.reason
    assert answer.state == "IDLE"
    assert world.navigation.goals == []


def test_charge_is_taken_from_the_robot_status_without_battery_state(world):
    world.bench.silence(topics.BATTERY_STATE)
    world.bench.repeat(topics.ROBOT_STATUS, lambda: RobotStatus(battery_percent=20.0), 10.0)
    world.launch()
    assert "battery at 20%" in world.command("START_MISSION", "ride").reason
    world.bench.silence(topics.ROBOT_STATUS)
    world.bench.run(topics.ROBOT_STATUS.stale_limit_s + 0.2)
    assert world.command("START_MISSION", "ride").last_command_accepted, "the charge is unknown"


def test_emergency_stop_command_and_its_release(world):
    world.launch()
    sources = world.bench.listen(topics.EMERGENCY_STOP_SOURCES)
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    assert world.command("EMERGENCY_STOP").state == "PAUSED"
    world.stops.wait(lambda message: message.data, "/emergency_stop true")
    world.no_goal()
    sources.wait(lambda message: message.name == "mission_manager" and message.pressed, "who has pressed")
    world.safety_says("EMERGENCY_STOP", "ESTOP_PRESSED")
    sources.wait(lambda message: not message.pressed and message.presses == 1, "an event, no state")
    assert world.stops.last.data  # the other nodes keep the stop
    world.display.wait(lambda message: message.state_num == Display.EMERGENCY_STOP, "e-stop on the display")
    assert "release it" in world.command("RESUME").reason

    world.bench.publish(topics.EMERGENCY_STOP, Bool(data=False))  # first step of the release
    assert not world.command("RESUME").last_command_accepted
    world.safety_says("NORMAL")  # second step
    # It withdraws its own latched true, which would stop a node that starts later.
    assert [stop.data for stop in world.stops.messages][-2:] == [False, False]
    assert world.status.last.state == "PAUSED"
    assert world.command("RESUME").state == "RUNNING"
    world.goal(2.0)


def test_a_pressed_button_stops_the_mission(world):
    world.launch()
    world.command("START_MISSION", "ride")
    world.bench.publish(topics.EMERGENCY_STOP, Bool(data=True))
    status = world.state("PAUSED")
    assert "emergency stop" in status.reason
    world.no_goal()


def test_stale_pose_is_reported(world):
    world.launch()
    world.command("START_MISSION", "ride")
    world.bench.silence(topics.CURRENT_POSE)
    world.status.wait(lambda s: "waiting for pose" in s.reason, "waiting for pose")
    assert world.status.last.state == "RUNNING"


def test_a_restarted_navigation_controller_receives_the_goal_once(world):
    world.launch()
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    world.bench.run(5.0)
    assert len(world.navigation.goals) == 1
    world.navigation.process.kill()
    world.bench.start_again(world.navigation.process)
    world.goal(2.0)
    world.bench.run(5.0)
    assert len(world.navigation.goals) == 2


def test_an_aborted_goal_is_sent_again_and_its_reason_shown_when_the_tries_are_over(world):
    world.launch(goal_retry_s=1.0, progress_timeout_s=2.0, tries=2)
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    while world.status.last.state == "RUNNING":
        world.navigation.end(208, "goal refused: no path")
        world.bench.run(0.5)
    assert world.status.last.state == "FAILED"
    assert world.status.last.reason.endswith("try 2 of 2; navigation: goal refused: no path (error 208)")
    assert len(world.navigation.goals) >= 2


def test_a_false_on_passenger_attached_detaches_nothing_that_the_latch_holds(world):
    latch = LatchStatus(closed=True, attached=True)
    world.bench.repeat(topics.LATCH_STATUS, lambda: latch, 10.0)
    world.launch()
    world.status.wait(lambda s: s.passenger_attached, "the passenger")
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=False))
    world.bench.run(1.0)
    assert world.status.last.passenger_attached
    world.kill()
    latch.attached = False
    world.launch()
    world.status.wait(lambda s: not s.passenger_attached, "the passenger that left during the restart")


def test_sigkill_during_a_mission_restores_it_paused_with_the_passenger(world):
    world.launch()
    world.bench.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    world.status.wait(lambda s: s.passenger_attached, "the passenger")
    world.command("START_MISSION", "ride")
    world.pose = Pose2(1.7, 0.0, 0.0)
    world.goal(4.0)
    world.kill()
    (world.missions / "ride.yaml").unlink()
    kept = SqliteJournal(world.journal).load()
    assert (kept.state, kept.waypoint, kept.passenger_attached) == (State.RUNNING, 1, True)

    sent = len(world.navigation.goals)
    world.launch()
    status = world.status.wait(lambda s: s.state == "PAUSED", "PAUSED")
    assert (status.mission_id, status.current_waypoint, status.waypoints_completed) == ("ride", "second", 1)
    assert status.passenger_attached
    assert "restarted while RUNNING" in status.reason
    world.bench.wait(lambda: world.navigation.goal is None, "the goal cancelled", 1.0)
    assert world.navigation.ended[-1] == "canceled", "the goal of the process that was killed"
    world.bench.run(5.0)
    assert len(world.navigation.goals) == sent, "it never moves by itself"
    assert world.command("RESUME").state == "RUNNING"
    world.goal(4.0)


def test_its_end_leaves_the_robot_without_a_goal(world):
    node = world.launch()
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    assert world.bench.stop(node) == 0
    world.no_goal()
    assert SqliteJournal(world.journal).load().state is State.RUNNING


def test_damaged_journal_is_reported_and_moved_aside(world):
    world.journal.parent.mkdir()
    world.journal.write_bytes(os.urandom(8192))
    world.launch()
    status = world.state("IDLE")
    assert "was damaged" in status.reason
    assert list(world.journal.parent.glob("*.damaged-*"))
    assert world.command("START_MISSION", "ride").last_command_accepted


def test_a_full_disk_during_a_ride_pauses_it(world):
    disk = world.bench.devices.disk
    world.launch()
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    disk.full = True
    world.pose = Pose2(1.7, 0.0, 0.0)
    status = world.state("PAUSED")
    assert "the journal cannot be written" in status.reason
    world.no_goal()
    assert not world.command("RESUME").last_command_accepted
    disk.full = False
    assert world.command("RESUME").state == "RUNNING"
    assert SqliteJournal(world.journal).load().state is State.RUNNING
    world.goal(4.0)


# --- orders ----------------------------------------------------------------------------------------------------------


def edit(world: World, operation: str, order_id: str = "", mission_id: str = "ride", **fields: Any) -> Any:
    origin = MissionOrder.CLI if operation == "RELEASE" else MissionOrder.FLEET
    order = MissionOrder(id=order_id, mission_id=mission_id, origin=origin, priority=100, **fields)
    request = EditMissionQueue.Request(operation=getattr(EditMissionQueue.Request, operation), order=order)
    return world.bench.call(services.EDIT_MISSION_QUEUE, request)


def rides(world: World, *more: Pose2) -> None:
    """Moves the robot along the waypoints of the ride, and to ``more``, until it has ended."""
    for pose in (Pose2(1.7, 0.0, 0.0), Pose2(4.0, 1.0, 0.5), Pose2(4.0, 3.0, 0.0), *more):
        world.goal(pose.x if pose.x != 1.7 else 2.0)
        world.pose = pose
        world.bench.run(3.0)
    world.state("COMPLETED")
    world.pose = Pose2(0.0, 0.0, 0.0)


def test_orders_wait_for_one_touch_after_a_kill_and_then_run_one_after_the_other(world):
    queue = world.bench.listen(topics.MISSION_QUEUE)
    world.launch()
    for order_id in ("a", "b", "a"):
        assert edit(world, "ADD", order_id).success
    world.kill()
    world.launch()
    reported = queue.wait(lambda q: q.held_by == MissionQueue.RESTART and q.orders, "the queue")
    assert [(order.id, order.origin) for order in reported.orders] == [("a", "fleet"), ("b", "fleet")]
    world.bench.run(20.0)
    assert world.navigation.goals == [], "nothing moves by itself"

    assert edit(world, "RELEASE").success
    for _ in range(2):
        world.bench.run(10.0)  # of next_order_after_s
        rides(world)
    ended = [(order.id, order.state) for order in queue.last.ended]
    assert ended == [("a", MissionOrder.COMPLETED), ("b", MissionOrder.COMPLETED)]
    assert edit(world, "ADD", "a").success
    world.bench.run(20.0)
    assert world.status.last.state == "COMPLETED", "an id is one order"


def test_a_critical_battery_drives_to_the_safe_place_of_the_configuration(world):
    world.launch()
    world.command("START_MISSION", "ride")
    world.goal(2.0)
    world.safety_says("DEGRADED", "BATTERY_LOW", "BATTERY_CRITICAL")
    assert "driving to the safe place 'base'" in world.state("RUNNING", "base").reason
    world.goal(0.0)
    assert "at the safe place 'base'" in world.state("PAUSED").reason
    world.no_goal()
    assert not world.command("RESUME").last_command_accepted
    world.safety_says("NORMAL")
    assert world.command("RESUME").state == "RUNNING"
    world.goal(2.0)
