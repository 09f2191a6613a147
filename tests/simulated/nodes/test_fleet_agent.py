"""The fleet agent with the mission manager and the navigation controller, on a robot without inertia, and a master."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Float32

from custom_msgs.msg import MissionOrder, SafetyStatus
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version
from robot_stack.middleware.conversions import pose_from_msg
from tests.simulated.bench import Bench
from tests.simulated.nodes.robot import BLIND, DrivenRobot
from tests.unit.fleet.master import HEADER, action, in_version, node, node_ids, order, statuses

_LIMIT_S = 60.0


class Site:
    """A master beside a robot that drives."""

    def __init__(self, bench: Bench, folder: Path, version: Version) -> None:
        self.bench, self.version = bench, version
        self.robot = DrivenRobot(bench)
        self.broker = bench.devices.broker
        self.status, self.poses = bench.listen(topics.MISSION_STATUS), bench.listen(topics.INITIAL_POSE)
        self.queue = bench.listen(topics.MISSION_QUEUE)
        bench.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
        bench.repeat(topics.BATTERY_STATE, lambda: BatteryState(percentage=0.8, voltage=50.0), 1.0)
        bench.repeat(topics.LOCALIZATION_QUALITY, lambda: Float32(data=0.9), 10.0)
        self.navigation = bench.start("navigation_controller", BLIND)
        self.manager = bench.start("mission_manager", {"journal_file": str(folder / "mission.db")})
        settings = {"journal_file": str(folder / "fleet.json"), "protocol_version": version.value}
        self.agent = bench.start("fleet_agent", settings)
        bench.run(1.0)
        assert self.ask(EditMissionQueue.Request.RELEASE).success

    def ask(self, operation: int) -> Any:
        """A request of staff."""
        answers: list[Any] = []
        order_of_staff = MissionOrder(origin=MissionOrder.CLI)
        client = self.bench.port.client(services.EDIT_MISSION_QUEUE.type, services.EDIT_MISSION_QUEUE.name)
        self.bench.run(0.5)
        client.call(EditMissionQueue.Request(operation=operation, order=order_of_staff), answers.append)
        return self.bench.wait(lambda: answers and answers[0], "an answer")

    def send(self, topic: Topic, data: dict[str, Any]) -> None:
        """A message of 2.1.0, sent in the robot's version."""
        self.broker.publish(topic, json.dumps(in_version(topic, data, self.version)).encode())

    def instant(self, *actions: dict[str, Any]) -> None:
        self.send(Topic.INSTANT_ACTIONS, HEADER | {"actions": list(actions)})

    @property
    def state(self) -> dict[str, Any]:
        return next((data for topic, data in reversed(self.broker.messages) if topic is Topic.STATE), {})

    def wait(self, condition: Callable[[dict[str, Any]], Any], what: str, limit_s: float = _LIMIT_S) -> dict[str, Any]:
        """The first state that fulfils it, from the present one on."""
        self.bench.wait(lambda: self.state and condition(self.state), what, limit_s)
        return self.state


@pytest.fixture(params=list(Version))
def site(bench: Bench, tmp_path: Path, request: pytest.FixtureRequest) -> Site:
    return Site(bench, tmp_path, request.param)


def first_part() -> dict[str, Any]:
    return order([node("a", 0, 0.0), node("b", 2, 2.0), node("c", 4, 3.0, released=False)])


def second_part() -> dict[str, Any]:
    return order([node("b", 2, 2.0), node("c", 4, 3.0, action("wait", duration=2.0))], update=1)


def test_an_order_in_two_updates_is_driven(site: Site) -> None:
    site.wait(lambda state: state["operatingMode"] == "AUTOMATIC", "the fleet in control")
    site.send(Topic.ORDER, first_part())
    site.wait(lambda state: state["orderId"] == "order_1" and node_ids(state) == ["b", "c"], "the order taken over")
    site.wait(lambda state: state["driving"], "the robot drives")
    site.wait(lambda state: state["newBaseRequest"], "the request for a base")
    site.wait(lambda state: node_ids(state) == ["c"] and not state["driving"], "the end of the base")
    assert abs(site.robot.pose.x - 2.0) < 0.05
    site.bench.run(10.0)
    assert abs(site.robot.pose.x - 2.0) < 0.05  # not a step beyond the base
    site.send(Topic.ORDER, second_part())
    site.wait(lambda state: statuses(state).get("wait") == "RUNNING", "the action runs")
    state = site.wait(lambda state: statuses(state).get("wait") == "FINISHED", "the action is done")
    site.wait(lambda state: not state["nodeStates"], "the end")
    assert state["lastNodeId"] == "c"
    assert state["errors"] == []
    site.status.wait(lambda status: status.state == "COMPLETED", "the mission done", 5.0)


def test_the_robot_keeps_the_speeds_of_each_edge(site: Site) -> None:
    limits = site.bench.listen(topics.MISSION_VELOCITY_LIMIT)
    driven: list[tuple[float, float, float]] = []
    site.bench.listen(
        topics.CMD_VEL, lambda message: driven.append((site.robot.pose.x, message.linear.x, message.angular.z))
    )
    data = order([node("a", 0, 0.0), node("b", 2, 3.0), node("c", 4, 7.0), node("d", 6, 9.0, theta=1.5)])
    data["edges"][0]["maxSpeed"] = 0.4
    data["edges"][2] |= {"maxSpeed": 0.3, "maxRotationSpeed": 0.15}
    site.send(Topic.ORDER, data)
    site.wait(lambda state: not state["nodeStates"] and state["orderId"], "the end", 120.0)

    def fastest(first_m: float, last_m: float) -> float:
        return max(speed for x, speed, _ in driven if first_m <= x <= last_m)

    # A node is passed within 0.5 m. There the robot, which could have to stop at it, brakes.
    assert 0.3 < fastest(0.0, 2.5) <= 0.4
    assert fastest(3.0, 6.5) > 0.6
    assert 0.2 < fastest(7.0, 9.5) <= 0.3
    assert 0.1 < max(turn for x, _, turn in driven if x > 7.0) <= 0.15
    limits.wait(lambda message: math.isinf(message.max_linear_velocity), "goals of others without a limit")
    assert math.isinf(limits.last.max_angular_velocity)


def test_cancel_order_stops_the_robot(site: Site) -> None:
    site.send(Topic.ORDER, order([node("a", 0, 0.0), node("far", 2, 20.0)]))
    site.bench.wait(lambda: site.robot.pose.x > 1.0, "one metre", _LIMIT_S)
    site.instant(action("cancelOrder"))
    state = site.wait(lambda state: statuses(state).get("cancelOrder") == "FINISHED", "cancelled", 10.0)
    assert (state["driving"], state["nodeStates"]) == (False, [])
    stood = site.robot.pose
    site.bench.run(3.0)
    assert site.robot.pose.distance_to(stood) < 0.001  # driving ends at 0.02 m/s


def test_pause_and_go_on(site: Site) -> None:
    site.send(Topic.ORDER, order([node("a", 0, 0.0), node("b", 2, 4.0)]))
    site.bench.wait(lambda: site.robot.pose.x > 1.0, "one metre", _LIMIT_S)
    site.instant(action("startPause", "p1"))
    site.wait(lambda state: state["paused"] and not state["driving"], "the pause", 10.0)
    stood = site.robot.pose
    site.bench.run(5.0)
    assert site.robot.pose.distance_to(stood) < 0.001
    site.instant(action("stopPause", "p2"))
    site.wait(lambda state: not state["nodeStates"], "the end")
    assert statuses(site.state) == {"p1": "FINISHED", "p2": "FINISHED"}


def test_a_killed_agent_goes_on_where_it_was(site: Site) -> None:
    site.send(Topic.ORDER, first_part())
    site.bench.wait(lambda: site.robot.pose.x > 0.5, "half a metre", _LIMIT_S)
    site.agent.kill()
    site.bench.run(5.0)
    assert abs(site.robot.pose.x - 2.0) < 0.05  # the base is driven to its end
    site.bench.start_again(site.agent)
    site.wait(lambda state: node_ids(state) == ["c"], "the order resumed")
    site.send(Topic.ORDER, second_part())
    site.wait(lambda state: not state["nodeStates"] and statuses(state) == {"wait": "FINISHED"}, "the end")
    assert [one.state for one in site.queue.last.ended] == [MissionOrder.COMPLETED]
    numbers = [data["headerId"] for topic, data in site.broker.messages if topic is Topic.STATE]
    assert numbers == sorted(set(numbers))


def test_a_pose_is_given_to_localization_while_no_mission_is_under_way(site: Site) -> None:
    pose = {"x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "yard", "lastNodeId": "n"}
    kind = "initializePosition" if site.version is Version.V3 else "initPosition"
    site.instant(action(kind, **pose))
    given = site.poses.wait(lambda message: True, "the pose")
    assert abs(pose_from_msg(given.pose.pose).yaw - 0.5) < 1e-9
    assert site.wait(lambda state: state["lastNodeId"] == "n", "the node")["errors"] == []


def test_the_connection_is_announced_and_ended(site: Site) -> None:
    site.bench.stop(site.agent)
    sent = [data["connectionState"] for topic, data in site.broker.messages if topic is Topic.CONNECTION]
    assert sent == ["ONLINE", "OFFLINE"]
    assert Topic.FACTSHEET in [topic for topic, _ in site.broker.messages]
