"""Inputs of the touch screen from the robot, as plain values."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from visualization_msgs.msg import Marker as MarkerMessage

from custom_msgs.msg import BuildingRequest, EmergencyStopSource
from robot_stack.contract import topics
from robot_stack.contract.faults import split_codes
from robot_stack.contract.model import SafetyState, System, Topic
from robot_stack.contract.states import ACTIVE, HeldBy
from robot_stack.core.doors import DoorWaits
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, time_to_s
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from robot_stack.ui.diagnostics import Diagnostics
from robot_stack.ui.protocol import Layer
from robot_stack.ui.self_test import Seen, SourceReports
from robot_stack.ui.snapshot import (
    Computer,
    Docking,
    ExternalDisplay,
    Limit,
    Marker,
    Order,
    Person,
    Queue,
    Ride,
    Safety,
    Snapshot,
)

# Topics shown by only some pages are subscribed to while such a page is open.
_BY_LAYER: dict[Layer, tuple[Topic, ...]] = {
    Layer.COSTMAP: (topics.LOCAL_COSTMAP, topics.ODOM),
    Layer.OBSTACLES: (topics.OBSTACLES,),
    Layer.PEOPLE: (topics.NAVIGATION_PEOPLE, topics.ODOM),
    Layer.DISPLAY: (topics.EHMI_STATUS,),
    Layer.MARKERS: (topics.ARUCO_DETECTIONS,),
    Layer.STOP_SOURCES: (topics.DIAGNOSTICS,),
    Layer.DIAGNOSTICS: (topics.DIAGNOSTICS,),
    Layer.FRONT_IMAGE: (topics.FRONT_IMAGE,),
    Layer.REAR_IMAGE: (topics.REAR_IMAGE,),
    Layer.SELF_TEST: (topics.EMERGENCY_STOP_SOURCES, topics.ODOM),
}
# Largest age of data shown below a picture: it is read at the node's wake-ups, five times a second.
_PICTURE_AGE_S = 1.0
# Without these inputs the display for riders would be wrong.
_NEEDED = (topics.SAFETY_STATUS, topics.MISSION_STATUS, topics.CURRENT_POSE, topics.BATTERY_STATE)


class RobotInputs:
    """callbacks: by name, for topics of which every message counts."""

    def __init__(self, node: StackNode, callbacks: dict[str, Callable[[Any], None]]) -> None:
        self._node = node
        self._callbacks = {
            **callbacks,
            topics.DIAGNOSTICS.name: self._on_diagnostics,
            topics.EMERGENCY_STOP_SOURCES.name: self._on_source,
        }
        self._sources = SourceReports(topics.EMERGENCY_STOP_SOURCES.stale_limit_s)
        self._diagnostics = Diagnostics()
        self._rows = topics.of_system(System.ROBOT)
        self._ride = node.subscribe(topics.MISSION_STATUS)
        self._queue = node.subscribe(topics.MISSION_QUEUE)
        self._limit = node.subscribe(topics.VELOCITY_LIMIT)
        self._docking = node.subscribe(topics.DOCKING_STATUS)
        self._battery = node.subscribe(topics.BATTERY_STATE)
        self._plan = node.subscribe(topics.PLAN)
        self._navigation = node.subscribe(topics.NAVIGATION_STATUS)
        self._pose = node.subscribe(topics.CURRENT_POSE)
        self._quality = node.subscribe(topics.LOCALIZATION_QUALITY)
        self._speed = node.subscribe(topics.CMD_VEL_LIMITED)
        self._robot = node.subscribe(topics.ROBOT_STATUS)
        self._doors = DoorWaits(topics.BUILDING_REQUEST.stale_limit_s)
        node.subscribe(topics.BUILDING_REQUEST, self._on_door)
        self._at_times: dict[str, Input] = {}

    def request_layers(self, layers: frozenset[Layer]) -> None:
        """Subscribes to the topics of these layers, and to no others."""
        rows = {row.name: row for layer in layers for row in _BY_LAYER.get(layer, ())}
        for name in self._at_times.keys() - rows.keys():
            self._node.unsubscribe(self._at_times.pop(name))
        for name in rows.keys() - self._at_times.keys():
            self._at_times[name] = self._node.subscribe(rows[name], self._callbacks.get(name))

    def latest(self, row: Topic, within_s: float | None = None) -> Any:
        """The newest message that is not too old, by its row or ``within_s``; None without one."""
        entry = self._at_times.get(row.name)
        if entry is None:
            return None
        fresh = entry.fresh() if within_s is None else 0.0 <= entry.age_s() <= within_s
        return entry.latest if fresh else None

    def pose(self) -> Pose2 | None:
        """base_link in map."""
        return pose_from_msg(self._pose.latest.pose) if self._pose.fresh() else None

    def odom_in_map(self) -> Pose2 | None:
        """The frame odom in map, None while either pose of base_link is unknown."""
        in_map, odom = self.pose(), self.latest(topics.ODOM, _PICTURE_AGE_S)
        return None if in_map is None or odom is None else in_map.compose(pose_from_msg(odom.pose.pose).inverse())

    def ride(self) -> Ride | None:
        return _ride(self._ride.latest)

    def diagnostics(self) -> dict[str, Any]:
        return self._diagnostics.section(self._rows, self._node.steady_s())

    def stop_sources(self) -> dict[str, Any]:
        return self._diagnostics.stop_sources(self._node.steady_s())

    def self_test(self) -> Seen:
        """What the self test checks; its topics are subscribed to while a page shows it."""
        safety, ride = _safety(self._node.safety_status_input), self.ride()
        odom = self.latest(topics.ODOM)
        return Seen(
            emergency=None if safety is None else safety.state == SafetyState.EMERGENCY_STOP.name,
            pressed_row=safety is not None and "ESTOP_PRESSED" in safety.faults,
            sources=self._sources.pressed(self._node.steady_s()),
            speed=None if odom is None else _speed(odom.twist),
            ride_active=None if ride is None else ride.state in ACTIVE,
            passenger=None if ride is None else ride.passenger,
        )

    def snapshot(self, *, staff_called: bool, driven_by_hand: bool) -> Snapshot:
        return Snapshot(
            safety=_safety(self._node.safety_status_input),
            limit=_limit(self._limit.latest) if self._limit.fresh() else None,
            ride=self.ride(),
            queue=_queue(self._queue.latest),
            docking=_docking(self._docking),
            computer=_computer(self._robot) if self._robot.fresh() else None,
            display=_display(self.latest(topics.EHMI_STATUS)),
            pose=self.pose(),
            quality=self._quality.latest.data if self._quality.fresh() else None,
            battery=self._battery.latest.percentage if self._battery.fresh() else None,
            speed=_speed(self._speed.latest) if self._speed.fresh() else None,
            plan=_plan(self._plan.latest),
            navigation=self._navigation.latest.data if self._navigation.latest is not None else "",
            door=self._doors.waiting(self._node.steady_s()),
            markers=_markers(self.latest(topics.ARUCO_DETECTIONS)),
            people=_people(self.latest(topics.NAVIGATION_PEOPLE), self.odom_in_map()),
            emergency_stop=self._node.emergency_stop,
            staff_called=staff_called,
            driven_by_hand=driven_by_hand,
            missing=self._missing(),
        )

    def _missing(self) -> tuple[str, ...]:
        states = self._node.input_states()
        return tuple(row.name for row in _NEEDED if row.name in states and not states[row.name].fresh)

    def _on_door(self, message: BuildingRequest) -> None:
        self._doors.on_request(message.name, message.phase, self._node.steady_s())

    def _on_source(self, message: EmergencyStopSource) -> None:
        self._sources.add(message.name, message.pid, message.pressed, self._node.steady_s())

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s = self._node.steady_s()
        for status in message.status:
            level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
            values = {item.key: item.value for item in status.values}
            self._diagnostics.update(status.name, level, status.message, values, now_s)


def _safety(entry: Input) -> Safety | None:
    if not entry.fresh():
        return None
    m = entry.latest
    return Safety(m.safety_state, tuple(m.active_faults), m.min_obstacle_distance, m.emergency_stop_active)


def _limit(m: Any) -> Limit | None:
    if m is None:
        return None
    return Limit(m.max_linear_velocity, m.max_angular_velocity, split_codes(m.reason))


def _ride(m: Any) -> Ride | None:
    if m is None:
        return None
    return Ride(
        state=m.state,
        mission_id=m.mission_id,
        waypoint=m.current_waypoint,
        completed=m.waypoints_completed,
        total=m.total_waypoints,
        progress=m.progress,
        eta_s=m.eta_s,
        passenger=m.passenger_attached,
        reason=m.reason,
        last_command=m.last_command,
        accepted=m.last_command_accepted,
    )


def _queue(m: Any) -> Queue | None:
    if m is None:
        return None
    held_by = HeldBy(m.held_by) if m.held_by in set(HeldBy) else HeldBy.STAFF
    current = _order(m.current[0]) if m.current else None
    return Queue(held_by.name, m.reason, tuple(_order(item) for item in m.orders), current, m.paused_by)


def _order(m: Any) -> Order:
    return Order(m.id, m.mission_id, m.origin, m.priority, time_to_s(m.earliest), m.open)


def _docking(entry: Input) -> Docking | None:
    if not entry.fresh():
        return None
    m = entry.latest
    return Docking(m.state, m.position_error, m.orientation_error, m.visible_markers_count, m.convergence_progress)


def _computer(entry: Input) -> Computer:
    m = entry.latest
    return Computer(m.cpu_usage_percent, m.memory_usage_percent, m.disk_usage_percent)


def _display(m: Any) -> ExternalDisplay | None:
    if m is None:
        return None
    state = None if m.acknowledged_state == m.NO_STATE else m.acknowledged_state
    return ExternalDisplay(m.linked, state, m.firmware_fault)


def _speed(m: Any) -> tuple[float, float]:
    twist = m.twist
    return math.hypot(twist.linear.x, twist.linear.y), twist.angular.z


def _plan(m: Any) -> tuple[tuple[float, float], ...]:
    return () if m is None else tuple((item.pose.position.x, item.pose.position.y) for item in m.poses)


def _markers(m: Any) -> tuple[Marker, ...]:
    if m is None:
        return ()
    return tuple(
        Marker(
            item.marker_id,
            item.camera_frame,
            item.quality_score,
            item.pose.position.x,
            item.pose.position.y,
            item.pose.position.z,
        )
        for item in m.detections
    )


def _people(m: Any, odom: Pose2 | None) -> tuple[Person, ...]:
    """Cylinders are people and objects; the arrow with the same number points to the position in one second."""
    if m is None or odom is None:
        return ()
    arrows = {item.id: item.points for item in m.markers if item.type == MarkerMessage.ARROW and len(item.points) == 2}
    found = []
    for item in m.markers:
        if item.type == MarkerMessage.CYLINDER:
            at = odom.compose(Pose2(item.pose.position.x, item.pose.position.y, 0.0))
            start, end = arrows.get(item.id, (item.pose.position, item.pose.position))
            speed = Pose2(0.0, 0.0, odom.yaw).compose(Pose2(end.x - start.x, end.y - start.y, 0.0))
            found.append(Person(item.ns, at.x, at.y, 0.5 * item.scale.x, speed.x, speed.y))
    return tuple(found)
