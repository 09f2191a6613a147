"""Publishers of the navigation controller: motion, the plan, the state, and tracked people."""

from __future__ import annotations

from collections.abc import Iterable

from builtin_interfaces.msg import Time
from std_msgs.msg import String

from robot_stack.contract import frames, topics
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.people import Person
from robot_stack.middleware.conversions import initial_pose, time_to_s, twist_to_msg
from robot_stack.middleware.node import StackNode
from robot_stack.navigation.doors import DoorRequest
from robot_stack.navigation.nodes.messages import building_request, path_message
from robot_stack.navigation.nodes.people_markers import people_markers
from robot_stack.navigation.path import Path

# Deviations of a pose in the cabin of a lift: of its places in both levels, and of the pose before the ride.
_CABIN_M, _CABIN_RAD = 0.15, 0.05


class NavigationOutputs:
    """Publishers of the node ``navigation_controller``. sightings: people seen in fewer grids are left out.

    requester: the session of this node with the building.
    """

    def __init__(self, node: StackNode, sightings: int) -> None:
        self._node, self._sightings = node, sightings
        self._cmd_vel = node.advertise(topics.CMD_VEL)
        self._plan = node.advertise(topics.PLAN)
        self._status = node.advertise(topics.NAVIGATION_STATUS)
        self._people = node.advertise(topics.NAVIGATION_PEOPLE)
        self._requests = node.advertise(topics.BUILDING_REQUEST)
        self._initial_pose = node.advertise(topics.INITIAL_POSE)
        self.requester = f"{node.get_name()}_{node.port.process_id}_{node.now_s():.3f}"
        self._shown_path: Path | None = None
        self._plan_shown = False
        self._status_text = ""

    def command(self, twist: Twist2) -> None:
        self._cmd_vel.publish(twist_to_msg(twist))

    def plan(self, path: Path | None) -> None:
        """Publishes each path once, and an empty one once if there is none."""
        if path is self._shown_path and self._plan_shown:
            return
        self._plan.publish(path_message(path, self._node.stamp()))
        self._shown_path, self._plan_shown = path, True

    def doors(self, requests: Iterable[DoorRequest]) -> None:
        for request in requests:
            self._requests.publish(building_request(request, self.requester, self._node.stamp()))

    def relocate(self, pose: Pose2 | None) -> None:
        """Publishes the pose from which localization goes on, in the cabin of a lift, if there is one."""
        if pose is not None:
            message = initial_pose(pose, frames.MAP, self._node.stamp(), _CABIN_M, _CABIN_RAD)
            self._initial_pose.publish(message)

    def status(self, text: str) -> None:
        if text != self._status_text:
            self._status.publish(String(data=text))
            self._status_text = text

    def people(self, people: Iterable[Person], stamp: Time) -> None:
        """Publishes the markers of a costmap if they have a subscriber."""
        if self._people.get_subscription_count():
            self._people.publish(people_markers(people, stamp, time_to_s(stamp), self._sightings))
