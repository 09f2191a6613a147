"""Conversions between messages and the values of the fleet agent's kernel."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import BatteryState

from custom_msgs.msg import MissionOrder, MissionQueue, MissionStatus, MissionWaypoint, SafetyStatus
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract.model import SafetyState
from robot_stack.fleet.progress import Request
from robot_stack.fleet.robot import FLEET, Battery, MissionView, Queue, Safety

_CHARGING = BatteryState.POWER_SUPPLY_STATUS_CHARGING
_PRIORITY = 100


def queue_of(message: MissionQueue) -> Queue:
    return Queue(
        message.held_by,
        message.reason,
        next((order.id for order in message.current), ""),
        frozenset(order.id for order in message.orders),
        {order.id: order.state for order in message.ended},
        message.paused_by,
        frozenset(order.id for order in message.orders if order.earliest == Time()),
    )


def mission_of(message: MissionStatus) -> MissionView:
    return MissionView(message.state, message.mission_id, message.waypoints_completed, message.reason)


def battery_of(message: BatteryState) -> Battery:
    charging = message.power_supply_status == _CHARGING
    return Battery(100.0 * message.percentage, message.voltage, charging)


def safety_of(message: SafetyStatus) -> Safety:
    emergency = message.safety_state == SafetyState.EMERGENCY_STOP.name
    return Safety(emergency or message.emergency_stop_active, tuple(message.active_faults))


def request_message(request: Request) -> Any:
    order = MissionOrder(
        id=request.order_id, mission_id=request.order_id, origin=FLEET, priority=_PRIORITY, open=request.open
    )
    waypoints = [
        MissionWaypoint(
            name=stop.name,
            x=stop.x,
            y=stop.y,
            yaw=stop.yaw,
            action=stop.kind.value,
            wait_s=stop.wait_s,
            dock_id=stop.dock_id,
            max_speed=stop.max_speed_mps,
            max_yaw_rate=stop.max_yaw_rate_radps,
        )
        for stop in request.stops
    ]
    return EditMissionQueue.Request(
        operation=int(request.operation), order=order, waypoints=waypoints, first=request.first
    )
