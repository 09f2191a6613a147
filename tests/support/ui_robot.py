"""The rest of the robot for tests of the touch screen: real DDS peers that answer like the robot's nodes."""

from __future__ import annotations

import functools
import math
from typing import Any

import cv2
import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from sensor_msgs.msg import BatteryState, Image
from std_msgs.msg import Float32, String

from custom_msgs.msg import (
    ArucoDetection,
    ArucoDetectionArray,
    DockingStatus,
    EHMIStatus,
    EmergencyStopSource,
    MissionQueue,
    MissionStatus,
    SafetyStatus,
    UICommand,
    VelocityLimit,
)
from robot_stack.contract import services, topics
from robot_stack.contract.display import Display
from robot_stack.core.geometry import quaternion_from_yaw
from robot_stack.core.health import INPUT_PREFIX, InputState, describe_input
from robot_stack.core.people import Person
from robot_stack.core.stop_presence import Presence, describe_presence
from robot_stack.middleware.point_cloud import cloud_message
from robot_stack.navigation.nodes.people_markers import people_markers
from tests.support.peer import Peer

_XYZ = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])


def _inputs(*states: InputState) -> dict[str, str]:
    return {f"{INPUT_PREFIX}{state.name}": describe_input(state) for state in states}


_REPORT = _inputs(
    InputState(topics.ODOM.name, age_s=0.01, rate_hz=50.0, fresh=True, received=120),
    InputState(topics.CURRENT_POSE.name, age_s=0.08, rate_hz=9.9, fresh=True, received=20),
)


class StandInRobot:
    """Stands at x 2 m, y 1 m; executes the touch screen's commands and records them.

    faults: reported in /safety/status beside the emergency stop. pressed: the stop button is pressed; ``press_button``
    also latches the stop.
    """

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        peer.listen(topics.EMERGENCY_STOP, self._on_stop)
        peer.listen(topics.UI_COMMAND, self._on_command)
        peer.listen(topics.UI_LANGUAGE, lambda message: self.languages.append(message.data))
        peer.listen(topics.GOAL_POSE, lambda message: self.goals.append(message))
        peer.listen(topics.INITIAL_POSE, self._on_pose)
        peer.listen(topics.TELEOP_CMD_VEL, lambda message: self.twists.append(message))
        peer.serve(services.SAFETY_RESET, self._on_reset)
        peer.serve(services.CLEAR_EMERGENCY_STOP, self._on_clear)
        peer.serve(services.EDIT_MISSION_QUEUE, self._on_edit)
        self.screen_pressed = False
        self.reset()

    def reset(self) -> None:
        """As at the start, without anything received; a press of the screen remains."""
        self.faults: list[str] = []
        self.emergency = self.pressed = False
        self.stop_sources: dict[str, Presence] = {}
        self.ride = MissionStatus(state="IDLE", eta_s=math.nan)
        self.docking = DockingStatus(state="IDLE", position_error=math.nan, orientation_error=math.nan)
        self.display = EHMIStatus(linked=True, acknowledged_state=Display.NAVIGATING)
        self.x, self.y, self.yaw = 2.0, 1.0, 0.4
        self.commands: list[str] = []
        self.languages: list[str] = []
        self.goals: list[PoseStamped] = []
        self.poses: list[Any] = []
        self.twists: list[TwistStamped] = []
        self.queue = MissionQueue(held_by=MissionQueue.RESTART, reason="queue held: the mission manager was restarted")
        for row, make, rate_hz in (
            (topics.SAFETY_STATUS, self._safety, 10.0),
            (topics.EMERGENCY_STOP_SOURCES, self._button, 5.0),
            (topics.CURRENT_POSE, self._pose, 10.0),
            (topics.DOCKING_STATUS, lambda: self.docking, 10.0),
            (topics.ODOM, self._odometry, 10.0),
            (topics.LOCALIZATION_QUALITY, lambda: Float32(data=0.93), 10.0),
            (topics.CMD_VEL_LIMITED, self._speed, 10.0),
            (topics.BATTERY_STATE, lambda: BatteryState(percentage=0.82), 2.0),
            (topics.DIAGNOSTICS, self._diagnostics, 5.0),
            (topics.LOCAL_COSTMAP, self._costmap, 5.0),
            (topics.OBSTACLES, _obstacles, 10.0),
            (topics.NAVIGATION_PEOPLE, self._people, 5.0),
            (topics.EHMI_STATUS, lambda: self.display, 5.0),
            (topics.FRONT_IMAGE, _picture, 5.0),
            (topics.ARUCO_DETECTIONS, _markers, 5.0),
        ):
            self.peer.repeat(row, make, rate_hz)
        self.say_ride()
        self.peer.publish(topics.MISSION_QUEUE, self.queue)
        self.say_limit(1.5)
        self._say_plan()
        self.peer.publish(topics.NAVIGATION_STATUS, String(data="no goal"))

    # --- messages to the screen ---------------------------------------------------------------------------------------

    def say_ride(self, **changes: Any) -> None:
        for name, value in changes.items():
            setattr(self.ride, name, value)
        self.peer.publish(topics.MISSION_STATUS, self.ride)

    def say_limit(self, linear_mps: float, reason: str = "") -> None:
        message = VelocityLimit(max_linear_velocity=linear_mps, max_angular_velocity=linear_mps, reason=reason)
        self.peer.repeat(topics.VELOCITY_LIMIT, lambda: message, 20.0)

    def press_button(self) -> None:
        self.emergency = self.pressed = True

    def _button(self) -> EmergencyStopSource:
        return EmergencyStopSource(name="emergency_stop_button", pid=1, presses=int(self.pressed), pressed=self.pressed)

    def _say_plan(self) -> None:
        path = Path()
        for step in range(60):
            pose = PoseStamped()
            pose.pose.position.x, pose.pose.position.y = self.x + 0.2 * step, self.y + 2.0 * math.sin(0.1 * step)
            path.poses.append(pose)
        self.peer.publish(topics.PLAN, path)

    def _safety(self) -> SafetyStatus:
        faults = [*(["ESTOP_PRESSED"] if self.emergency else []), *self.faults]
        state = "EMERGENCY_STOP" if self.emergency else "DEGRADED" if faults else "NORMAL"
        return SafetyStatus(
            safety_state=state, active_faults=faults, min_obstacle_distance=2.4, emergency_stop_active=self.pressed
        )

    def _fill(self, pose: Any) -> None:
        pose.position.x, pose.position.y = self.x, self.y
        _, _, pose.orientation.z, pose.orientation.w = quaternion_from_yaw(self.yaw)

    def _pose(self) -> PoseStamped:
        message = PoseStamped()
        self._fill(message.pose)
        return message

    def _odometry(self) -> Odometry:
        message = Odometry()
        self._fill(message.pose.pose)
        return message

    def _speed(self) -> TwistStamped:
        return self.twists[-1] if self.twists else TwistStamped()

    def _costmap(self) -> OccupancyGrid:
        grid = OccupancyGrid()
        grid.info.width = grid.info.height = 120
        grid.info.resolution = 0.05
        grid.info.origin.position.x, grid.info.origin.position.y = self.x - 3.0, self.y - 3.0
        grid.info.origin.orientation.w = 1.0
        rows, columns = np.mgrid[0:120, 0:120]
        near = np.hypot(rows - 90.0, columns - 95.0)
        costs = np.where(near < 8.0, 100, np.where(near < 22.0, 98 - 4.0 * (near - 8.0), 0)).astype(np.int8)
        grid.data = costs.ravel().tolist()
        return grid

    def _diagnostics(self) -> DiagnosticArray:
        stale = _inputs(InputState(topics.IMU.name, age_s=2.31, rate_hz=0.0, fresh=False, received=900))
        return DiagnosticArray(
            status=[
                _status("navigation_controller", "no goal", _REPORT),
                _status("ndt_localization", "stale: /sensors/imu", stale, DiagnosticStatus.WARN),
                _status("safety_monitor", "NORMAL", describe_presence(self.stop_sources)),
            ]
        )

    def _people(self) -> Any:
        """A person who walks to the right, a standing person, and an object."""
        x, y = self.x, self.y
        people = (
            Person(0.0, x + 1.5, y - 1.2, 1.1, 0.3, sightings=9, walks=True, walked=True),
            Person(0.0, x - 1.6, y + 1.4, sightings=9, walked=True),
            Person(0.0, x + 3.0, y + 2.0, radius_m=0.4, sightings=9),
            Person(0.0, x, y, sightings=1),  # a single sighting may be false
        )
        return people_markers(people, Time(), 0.0, 3)

    # --- messages from the screen -------------------------------------------------------------------------------------

    def _on_stop(self, message: Any) -> None:
        self.commands.append(f"stop {message.data}")
        self.screen_pressed = message.data
        self.emergency |= message.data
        if message.data and self.ride.state == "RUNNING":
            self.say_ride(state="PAUSED", reason="emergency stop")

    def _on_reset(self, _: Any, response: Any) -> Any:
        if self.pressed or self.screen_pressed:
            response.message = "refused: stop button pressed"
            return response
        self.emergency = False
        response.success = True
        return response

    def _on_clear(self, request: Any, response: Any) -> Any:
        self.commands.append(f"clear {request.source}")
        response.success = self.stop_sources.get(request.source) not in (None, Presence.THERE)
        response.message = f"cleared: {request.source}" if response.success else "refused: release it there"
        if response.success:
            del self.stop_sources[request.source]
        return response

    def _on_edit(self, request: Any, response: Any) -> Any:
        orders, operation = list(self.queue.orders), request.operation
        self.commands.append(f"queue {operation} {request.order.mission_id}".strip())
        place = next((index for index, order in enumerate(orders) if order.id == request.order.id), len(orders))
        if operation == request.ADD:
            orders.append(request.order)
        elif operation in (request.REMOVE, request.MOVE):
            order = orders.pop(place)
            if operation == request.MOVE:
                orders.insert(place + request.steps, order)
        elif operation == request.REPLACE and self.ride.state == "PAUSED":
            response.message = "no change of destination while the mission is PAUSED"
            return response
        elif operation == request.REPLACE:
            self.say_ride(mission_id=request.order.mission_id, reason="")
        else:
            self.queue.held_by = MissionQueue.NOTHING if operation == request.RELEASE else MissionQueue.STAFF
            self.queue.reason = "queue held: held by a person" if self.queue.held_by else ""
        self.queue.orders = orders
        self.peer.publish(topics.MISSION_QUEUE, self.queue)
        response.success = True
        return response

    def _on_command(self, message: UICommand) -> None:
        self.commands.append(f"{message.command_type} {message.mission_id}".strip())
        after = {"START_MISSION": "RUNNING", "PAUSE": "PAUSED", "RESUME": "RUNNING", "ABORT": "ABORTED"}
        changes = {"state": after[message.command_type]} if message.command_type in after else {}
        if message.command_type == "START_MISSION":
            changes |= {"mission_id": message.mission_id, "current_waypoint": "north path", "eta_s": 125.0}
            changes |= {"total_waypoints": 11, "waypoints_completed": 4, "progress": 0.38}
        self.say_ride(last_command=message.command_type, last_command_accepted=True, **changes)

    def _on_pose(self, message: Any) -> None:
        self.poses.append(message)
        self.x, self.y = message.pose.pose.position.x, message.pose.pose.position.y


def _status(name: str, text: str, values: dict[str, str], level: bytes = DiagnosticStatus.OK) -> DiagnosticStatus:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticStatus(name=name, level=level, message=text, values=pairs)


def _obstacles() -> Any:
    angle = np.linspace(0.0, 2.0 * math.pi, 300)
    points = np.zeros(300, _XYZ)
    points["x"], points["y"] = 2.6 + 0.5 * np.cos(angle), 0.4 + 0.5 * np.sin(angle)
    return cloud_message(points, "base_link")


@functools.cache
def _picture() -> Image:
    """A camera image with the markers of a dock."""
    grey = np.full((720, 1280), 150, np.uint8)
    grey[430:] = 110
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    for number, (x, y) in enumerate(((390, 220), (750, 220), (390, 400), (750, 400))):
        grey[y - 20 : y + 150, x - 20 : x + 150] = 255
        grey[y : y + 130, x : x + 130] = cv2.aruco.generateImageMarker(dictionary, number, 130)
    return Image(height=720, width=1280, step=1280, encoding="mono8", data=grey.tobytes())


def _markers() -> ArucoDetectionArray:
    found = ArucoDetectionArray()
    for number, (px, py) in enumerate(((455, 285), (815, 285), (455, 465), (815, 465))):
        detection = ArucoDetection(marker_id=number, quality_score=0.97, camera_frame="front_camera")
        at = detection.pose.position
        at.x, at.y, at.z = (px - 639.5) / 900.0, (py - 359.5) / 900.0, 1.0
        found.detections.append(detection)
    return found
