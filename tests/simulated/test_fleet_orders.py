"""An order of the fleet whose route is released piece by piece, on the whole robot in physics."""

from __future__ import annotations

import math
from typing import Any

from custom_msgs.msg import MissionOrder, MissionQueue, MissionWaypoint
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.core.geometry import Pose2
from tests.simulated.stage import Stage, staged_before_chair

START = Pose2(0.2, 0.3, math.radians(10.0))
_Request = EditMissionQueue.Request


def edit(stage: Stage, operation: int, *waypoints: tuple[str, float, str], first: int = 0, more: bool = True) -> None:
    """Of the fleet; the release is a person's. waypoints: name, x, action."""
    origin = MissionOrder.CLI if operation == _Request.RELEASE else MissionOrder.FLEET
    order = MissionOrder(id="tour_1", mission_id="tour", origin=origin, priority=100, open=more)
    route = [
        MissionWaypoint(
            name=name, x=x, y=11.0, yaw=math.pi, action=action, dock_id="chair_1" if action == "dock" else ""
        )
        for name, x, action in waypoints
    ]
    answer: Any = stage.call(
        services.EDIT_MISSION_QUEUE, _Request(operation=operation, order=order, waypoints=route, first=first)
    )
    assert answer.success, answer.message


def test_a_wheelchair_is_carried_along_a_route_that_is_released_on_the_way() -> None:
    with staged_before_chair(START) as stage:
        queue = stage.listen(topics.MISSION_QUEUE)
        begun_s = stage.now_s
        edit(stage, _Request.RELEASE)
        edit(stage, _Request.ADD, ("pick-up", -2.05, "dock"))
        stage.passenger.wait(lambda message: message.data, "the wheelchair on the latch", 120.0)
        stage.wait_mission("WAITING", 20.0)
        stage.assert_wheels_rest(5.0)

        edit(stage, _Request.EXTEND, ("back out", -0.5, "pass"), first=1)
        stage.mission.wait(lambda message: message.current_waypoint == "back out", "the next part", 5.0)
        stage.wait_faster(0.3, 20.0)
        edit(stage, _Request.EXTEND, ("way", 1.0, "pass"), first=2)
        stage.mission.wait(lambda message: message.current_waypoint == "way", "the part after it", 20.0)
        assert stage.speed_mps > 0.2, "without a stop at the end of the first one"
        stage.wait_mission("WAITING", 20.0)
        stage.wait_stands()

        edit(stage, _Request.EXTEND, ("destination", 3.0, "undock"), ("bay", 5.5, "park"), first=3)
        stage.wait_faster(0.3, 20.0)
        edit(stage, _Request.PAUSE)
        stage.wait_stands(5.0)
        assert queue.last.paused_by == "fleet"
        stage.run(0.5)  # the ramp's last steps
        stage.assert_wheels_rest(3.0)
        edit(stage, _Request.RESUME)
        stage.passenger.wait(lambda message: not message.data, "the wheelchair put down", 90.0)
        stage.mission.wait(lambda message: message.current_waypoint == "bay", "the way to the bay", 30.0)
        stage.wait_faster(0.3, 20.0)
        edit(stage, _Request.CANCEL)
        stage.wait_stands(5.0)
        assert stage.mission.last.state == "ABORTED"
        assert queue.last.held_by == MissionQueue.NOTHING
        assert [(order.id, order.state) for order in queue.last.ended] == [("tour_1", MissionOrder.ABORTED)]
        assert "EMERGENCY_STOP" not in stage.safety_states(begun_s)
