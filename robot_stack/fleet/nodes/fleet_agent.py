"""Node ``fleet_agent``: a vehicle of VDA 5050 between an MQTT broker and the mission manager."""

from __future__ import annotations

from functools import partial
from typing import Any

from robot_stack.contract import frames, services, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.site_map import map_checksum
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.headers import ConnectionMessages
from robot_stack.fleet.kernel import FleetKernel
from robot_stack.fleet.link import Connected, Disconnected, Link, LinkEvent, Received
from robot_stack.fleet.nodes.journal_file import JournalFile
from robot_stack.fleet.nodes.messages import (
    battery_of,
    mission_of,
    queue_of,
    request_message,
    safety_of,
)
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.progress import Request
from robot_stack.fleet.robot import RobotView
from robot_stack.fleet.vehicle import Vehicle
from robot_stack.middleware.conversions import initial_pose, pose_from_msg, twist_from_msg
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wheelchair import WheelchairInput


class FleetAgentNode(StackNode):
    def __init__(self) -> None:
        super().__init__("fleet_agent", FleetParams)
        self._pose = self.subscribe(topics.CURRENT_POSE)
        self._quality = self.subscribe(topics.LOCALIZATION_QUALITY)
        self._odom = self.subscribe(topics.ODOM)
        self._battery = self.subscribe(topics.BATTERY_STATE)
        self._mission = self.subscribe(topics.MISSION_STATUS)
        self._queue = self.subscribe(topics.MISSION_QUEUE)
        self._wheelchair = WheelchairInput(self)
        self._initial_pose = self.advertise(topics.INITIAL_POSE)
        self._edit = self.client(services.EDIT_MISSION_QUEUE)
        self._link_text = "connecting"
        self._journal = JournalFile(self.params.journal_file)
        record, problem = self._journal.load()
        if problem:
            self.get_logger().error(problem)
        docks = {name: dock.kind for name, dock in load_docks().docks.items()}
        vehicle = Vehicle.of(self.params, self.robot, docks, map_checksum(self.params.map)[:16])
        self._kernel = FleetKernel(self.params, vehicle, factsheet(self.robot, vehicle, self.params), record)
        # Header ids are reserved before the link sends the first one.
        self._unsaved = self._journal.save(self._kernel.record)
        messages = ConnectionMessages(self._kernel.headers, self.port.system_s)
        self._link: Link = self.device(
            MqttLink,
            self.params.broker,
            self.params.identity.serial_number,
            self.params.identity.prefix(self.params.protocol_version),
            messages.online,
            messages.offline,
            messages.broken,
        )
        self.every(self.params.tick_rate_hz, self._tick)

    def _tick(self) -> None:
        for event in self._link.receive():
            self._on_event(event)
        self._kernel.tick(self._robot_view(), self.steady_s(), self.port.system_s())
        self._unsaved = self._journal.save(self._kernel.record)
        if not self._unsaved:
            self._perform()
        self.set_health(not self._unsaved, self._unsaved or self._link_text)

    def _on_event(self, event: LinkEvent) -> None:
        match event:
            case Connected():
                self._link_text = "connected"
                self._kernel.connected()
            case Disconnected(reason):
                self._link_text = f"not connected: {reason}"
            case Received(topic, payload):
                self._kernel.receive(topic, payload)

    def _perform(self) -> None:
        """What the record, which is on the disk, is the reason for."""
        outputs = self._kernel.take()
        if outputs.request is not None:
            self._ask(outputs.request)
        if outputs.pose is not None:
            self._initial_pose.publish(initial_pose(outputs.pose, frames.MAP, self.stamp()))
        for topic, payload in outputs.messages.items():
            self._link.send(topic, payload)

    def _ask(self, request: Request) -> None:
        """Without an answer the kernel repeats it."""
        if self._edit.service_is_ready():
            self._edit.call(request_message(request), partial(self._on_answer, request))

    def _on_answer(self, request: Request, response: Any) -> None:
        self._kernel.answered(request, response.success, response.message)

    def _robot_view(self) -> RobotView:
        safety, battery = self.safety_status_input, self._battery
        return RobotView(
            pose=pose_from_msg(self._pose.latest.pose) if self._pose.fresh() else None,
            quality=self._quality.latest.data if self._quality.fresh() else 0.0,
            twist=twist_from_msg(self._odom.latest.twist.twist) if self._odom.fresh() else None,
            battery=battery_of(battery.latest) if battery.fresh() else None,
            safety=safety_of(safety.latest) if safety.fresh() else None,
            mission=mission_of(self._mission.latest) if self._mission_manager(self._mission) else None,
            queue=queue_of(self._queue.latest) if self._mission_manager(self._queue) else None,
            loaded=self._wheelchair.attached,
        )

    def _mission_manager(self, entry: Any) -> bool:
        """Its latched messages count while it is there."""
        return entry.latest is not None and bool(self.count_publishers(entry.topic.name))

    def destroy_node(self) -> None:
        self._link.close()
        super().destroy_node()
