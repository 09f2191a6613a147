"""Node ``system_monitor``: the robot in one message, the computer's temperature, diagnostics of all nodes as a tree."""

from __future__ import annotations

import math
from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Temperature

from custom_msgs.msg import RobotStatus
from robot_stack.contract import frames, topics
from robot_stack.contract.model import System
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from robot_stack.system_monitor.computer import CpuUsage, hottest
from robot_stack.system_monitor.diagnostics_tree import DiagnosticsTree
from robot_stack.system_monitor.nodes.computer_reader import ProcessReader, configured_reader
from robot_stack.system_monitor.nodes.entries import Entries
from robot_stack.system_monitor.nodes.graph_reader import GraphReader
from robot_stack.system_monitor.nodes.messages import (
    UNKNOWN_POSE,
    battery_of,
    fill,
    level_of,
    mission_of,
    tree_status,
)
from robot_stack.system_monitor.params import SystemMonitorParams
from robot_stack.system_monitor.robot_status import Battery, Mission, Safety, Summary, Usage
from robot_stack.system_monitor.topic_health import TopicHealth


class SystemMonitorNode(StackNode):
    def __init__(self) -> None:
        super().__init__("system_monitor", SystemMonitorParams)
        params: SystemMonitorParams = self.params
        self._computer = self.device(configured_reader, params)
        self._cpu = CpuUsage(params.cpu_window_s)
        self._tree = DiagnosticsTree(params.base_path, params.groups, params.nodes, params.stale_after_s)
        self._traffic = TopicHealth(params.stale_after_s)
        self._graph = GraphReader(self, topics.of_system(System.ROBOT, System.SIMULATION))
        self._message = RobotStatus()
        self._message.header.frame_id = frames.MAP
        self._subscribe()
        self._status = self.advertise(topics.ROBOT_STATUS)
        self._temperature = self.advertise(topics.COMPUTER_TEMPERATURE)
        self._agg = self.advertise(topics.DIAGNOSTICS_AGG)
        processes = self.device(ProcessReader, tuple(params.nodes))
        self._entries = Entries(
            params, params.nodes, self._computer, self._graph, self._traffic, processes, self.port.system_s
        )
        self.report.more = lambda: self._entries.entries(self.monotonic_s())
        self.every(topics.ROBOT_STATUS.nominal_rate_hz, self._publish_status)
        self.every(topics.COMPUTER_TEMPERATURE.nominal_rate_hz, self._read_computer)
        self.every_real(topics.DIAGNOSTICS_AGG.nominal_rate_hz, self._publish_tree)
        self.every_real(1.0 / params.graph_period_s, self._look_around)
        self.every_real(1.0 / params.process_period_s, self._entries.read_processes)
        self.every_real(1.0 / params.pss_period_s, self._entries.read_pss)

    def _subscribe(self) -> None:
        self._battery = self.subscribe(topics.BATTERY_STATE)
        self._quality = self.subscribe(topics.LOCALIZATION_QUALITY)
        self._pose = self.subscribe(topics.CURRENT_POSE)
        self._mission = self.subscribe(topics.MISSION_STATUS)
        # These only feed rates and ages in this node's own entry of /diagnostics.
        self.subscribe(topics.EHMI_STATUS)
        self.subscribe(topics.UI_HEARTBEAT)
        self.subscribe(topics.DIAGNOSTICS, self._on_diagnostics)

    # --- the robot ---------------------------------------------------------------------------------------------------

    def _publish_status(self) -> None:
        pose = self._pose.latest.pose if _usable(self._pose) and self._pose.fresh() else UNKNOWN_POSE
        fill(self._message, self._summary(), pose)
        self._message.header.stamp = self.stamp()
        self._status.publish(self._message)
        self.set_health(True, "watching")

    def _summary(self) -> Summary:
        safety = self.safety_status_input
        return Summary(
            battery=battery_of(self._battery.latest) if self._battery.fresh() else Battery(),
            quality=self._quality.latest.data if self._quality.fresh() else math.nan,
            safety=Safety(safety.latest.safety_state, tuple(safety.latest.active_faults))
            if safety.fresh()
            else Safety(),
            mission=self._current_mission(),
            usage=self._usage(),
        )

    def _current_mission(self) -> Mission:
        """The status is latched, so it is valid while its publisher exists."""
        known = _usable(self._mission) and self._graph.publishers(topics.MISSION_STATUS.name) > 0
        return mission_of(self._mission.latest) if known else Mission()

    def _usage(self) -> Usage:
        """The processor's use by ten readings a second, memory and disk by five."""
        before = self._entries.usage
        cpu_percent = self._cpu.update(self._computer.cpu(), self.monotonic_s())
        self._entries.usage = replace(before, cpu_percent=cpu_percent)
        return self._entries.usage

    def _read_computer(self) -> None:
        memory_percent, disk_percent = self._computer.memory_percent(), self._computer.disk_percent()
        self._entries.usage = replace(self._entries.usage, memory_percent=memory_percent, disk_percent=disk_percent)
        self._publish_temperature()

    def _publish_temperature(self) -> None:
        self._entries.zones = self._computer.zones()
        zone, celsius = hottest(self._entries.zones)
        message = Temperature(temperature=celsius)  # variance 0: unknown
        message.header.stamp, message.header.frame_id = self.stamp(), zone
        self._temperature.publish(message)

    # --- diagnostics -------------------------------------------------------------------------------------------------

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s = self.monotonic_s()
        for status in message.status:
            self._tree.update(status.name, level_of(status), status.message, status, now_s)
            self._traffic.update(status.name, ((item.key, item.value) for item in status.values), now_s)

    def _look_around(self) -> None:
        self._graph.look()
        self._computer.find_disk()

    def _publish_tree(self) -> None:
        if not self._agg.get_subscription_count():
            return  # no subscriber for the sixty entries
        message = DiagnosticArray(status=[tree_status(entry) for entry in self._tree.entries(self.monotonic_s())])
        message.header.stamp = self.stamp()
        self._agg.publish(message)


def _usable(entry: Input) -> bool:
    return entry.latest is not None
