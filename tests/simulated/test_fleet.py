"""A master has the demonstration's transport driven: an order in two updates, followed by its states.

The agent is killed while the robot docks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from custom_msgs.msg import MissionOrder
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services
from robot_stack.core.geometry import Pose2
from robot_stack.fleet.link import Topic
from tests.simulated.stage import Stage, staged
from tests.support.environment import own_config
from tests.unit.fleet.master import action, node, node_ids, order, statuses

START = Pose2(-1.85, 11.0, math.pi)
LIMIT_S = 240.0
SOON = "mission_manager.next_order_after_s=1.0"


def first_part() -> dict[str, Any]:
    """To the chair and away with it; where it is put down is not released yet."""
    pick = action("pick", stationName="chair_1", stationType="wheelchair", loadType="wheelchair", loadId="chair 7")
    return order(
        [
            node("start", 0, START.x, y=START.y, allowedDeviationXY=0.5),
            node("pick-up", 2, -2.05, pick, y=11.0, theta=math.pi),
            node("back out", 4, -2.3, y=11.0, theta=math.pi),
            node("corner", 6, -1.5, y=12.6, theta=math.pi / 2.0),
            node("north path", 8, 0.5, y=13.0, theta=0.0),
            node("destination", 10, 1.5, released=False, y=13.0, theta=0.0),
        ]
    )


def second_part() -> dict[str, Any]:
    return order(
        [
            node("north path", 8, 0.5, y=13.0, theta=0.0),
            node("destination", 10, 1.5, action("drop"), y=13.0, theta=0.0),
            node("clear", 12, 0.5, y=13.0, theta=0.0),
        ],
        update=1,
    )


class Master:
    """Follows the states."""

    def __init__(self, stage: Stage) -> None:
        self._stage, self._broker = stage, stage.stack.broker

    @property
    def states(self) -> list[dict[str, Any]]:
        return [data for topic, data in self._broker.messages if topic is Topic.STATE]

    def send(self, data: dict[str, Any]) -> None:
        self._broker.publish(Topic.ORDER, json.dumps(data).encode())

    def wait(self, condition: Callable[[dict[str, Any]], Any], what: str) -> dict[str, Any]:
        self._stage.wait(lambda: self.states and condition(self.states[-1]), what, LIMIT_S)
        return self.states[-1]


def release(stage: Stage) -> None:
    """By staff, on the command line."""
    answers: list[Any] = []
    client = stage.stack.test_tool.port.client(services.EDIT_MISSION_QUEUE.type, services.EDIT_MISSION_QUEUE.name)
    stage.run(1.0)
    request = EditMissionQueue.Request.RELEASE
    client.call(EditMissionQueue.Request(operation=request, order=MissionOrder(origin="cli")), answers.append)
    stage.wait(lambda: answers, "an answer", 10.0)
    assert answers[0].success, answers[0].message


@contextmanager
def with_agent(folder: Path) -> Iterator[None]:
    """The fleet agent is one of the profile's processes."""
    with own_config(folder) as config:
        profile = config / "profiles/sim.yaml"
        text = profile.read_text(encoding="utf-8")
        profile.write_text(text.replace("processes:\n", "processes:\n  - fleet_agent\n", 1), encoding="utf-8")
        yield


@pytest.mark.timeout(900)  # a ride of two minutes with a docking and an undocking
def test_a_transport_by_a_master_while_the_agent_dies(tmp_path: Path) -> None:
    with with_agent(tmp_path), staged("yard", SOON, start=START) as stage:
        begun_s = stage.now_s
        master = Master(stage)
        assert master.wait(lambda state: True, "a state")["operatingMode"] == "SERVICE"
        release(stage)
        master.wait(lambda state: state["operatingMode"] == "AUTOMATIC", "the control")
        master.send(first_part())
        master.wait(lambda state: statuses(state) == {"pick": "RUNNING"}, "the picking")
        assert master.states[-1]["lastNodeId"] == "pick-up"
        stage.kill("fleet_agent")
        stage.expected_failures.add("fleet_agent")
        state = master.wait(lambda state: statuses(state) == {"pick": "FINISHED"}, "the chair on the latch")
        assert stage.world.sim.world.attached
        assert stage.passenger.last.data
        master.wait(lambda state: state["newBaseRequest"], "the request for a base")
        master.send(second_part())
        master.wait(lambda state: statuses(state).get("drop") == "RUNNING", "the chair is put down")
        assert stage.limit.last.max_linear_velocity <= 1.0
        assert master.states[-1]["loads"] == [{"loadType": "wheelchair", "loadPosition": "front", "loadId": "chair 7"}]
        state = master.wait(lambda state: not state["nodeStates"], "the end")
        assert (node_ids(state), statuses(state)) == ([], {"pick": "FINISHED", "drop": "FINISHED"})
        assert (state["lastNodeId"], state["loads"]) == ("clear", [])
        stage.wait_mission("COMPLETED")
        stage.wait_stands()
        assert not stage.world.sim.world.attached
        assert not stage.passenger.last.data
        assert stage.wheelchair().distance_to(Pose2(2.4, 13.0, 0.0)) < 0.15
        assert stage.at().distance_to(stage.wheelchair()) > 1.7
        assert "EMERGENCY_STOP" not in stage.safety_states(begun_s)
