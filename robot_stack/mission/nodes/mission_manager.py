"""Node ``mission_manager``: receives UI commands, sends goals, mission status and the external display's state."""

from __future__ import annotations

import math
from typing import Any

from sensor_msgs.msg import BatteryState
from std_msgs.msg import String

from custom_msgs.msg import BuildingRequest, UICommand
from robot_stack.contract import services, topics
from robot_stack.contract.display import Display
from robot_stack.core.config import load
from robot_stack.core.departure import DepartureParams
from robot_stack.core.docks import load_docks
from robot_stack.core.doors import DoorWaits
from robot_stack.core.keepout import load_keepout
from robot_stack.core.mission_library import mission_library
from robot_stack.core.navigation_waits import load_navigation_waits
from robot_stack.core.safe_places import SafePlaces
from robot_stack.middleware.conversions import pose_from_msg, twist_from_msg
from robot_stack.middleware.motion_warning import MotionWarnings
from robot_stack.middleware.navigation_client import NavigationClient
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wheelchair import WheelchairInput
from robot_stack.mission import events as ev
from robot_stack.mission.journal import SqliteJournal, journal_path
from robot_stack.mission.kernel import MissionKernel
from robot_stack.mission.nodes.docking_client import DockingClient
from robot_stack.mission.nodes.outputs import MissionOutputs
from robot_stack.mission.nodes.queue_messages import request_of
from robot_stack.mission.params import MissionParams
from robot_stack.mission.perform import Performer, load_record

_CHARGING = BatteryState.POWER_SUPPLY_STATUS_CHARGING


class MissionManagerNode(StackNode):
    def __init__(self) -> None:
        super().__init__("mission_manager", MissionParams)
        self._navigation = NavigationClient(self, self._handle)
        self._docking = DockingClient(self, self._handle)
        # Its warnings do not depend on other nodes': it cancels the goal before it sends a new one.
        self._motion_warnings = MotionWarnings(self, given=lambda: None)
        self._outputs = MissionOutputs(self, self.params, self._navigation, self._docking, self._motion_warnings)
        self._pose = self.subscribe(topics.CURRENT_POSE)
        self._odom = self.subscribe(topics.ODOM)
        self._battery = self.subscribe(topics.BATTERY_STATE)
        self._robot_status = self.subscribe(topics.ROBOT_STATUS)
        self._teleop = self.subscribe(topics.TELEOP_CMD_VEL)
        self._doors = DoorWaits(topics.BUILDING_REQUEST.stale_limit_s)
        self.subscribe(topics.BUILDING_REQUEST, self._on_door)
        self._plan = self.subscribe(topics.PLAN)
        self._navigation_status = self.subscribe(topics.NAVIGATION_STATUS)
        self._docking_status = self.subscribe(topics.DOCKING_STATUS)
        self._library = mission_library(self.params.missions_folder, self.params.own_missions_folder)
        self._journal = self.device(SqliteJournal, journal_path(self.params.journal_file))
        record, problem = load_record(self._journal)
        if problem:
            self.get_logger().error(problem)
        docks = {name: dock.kind for name, dock in load_docks().docks.items()}
        self._kernel = MissionKernel(
            self.params.with_waits(load_navigation_waits().longest_s),
            load(DepartureParams, "departure"),
            record,
            problem,
            docks,
            load(SafePlaces, "safe_places"),
            load_keepout(self.params.map, self.robot),
        )
        self._performer = Performer(self._kernel, self._journal, self._outputs)
        self._performer.start_up(self._inputs(), self.steady_s())
        self.subscribe(topics.UI_COMMAND, self._on_command)
        self.serve(services.EDIT_MISSION_QUEUE, self._on_edit)
        self.subscribe(topics.UI_LANGUAGE, self._on_language)
        WheelchairInput(self, self._on_wheelchair, assumed=record.passenger_attached)
        self.every(self.params.tick_rate_hz, self._tick)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_command(self, message: UICommand) -> None:
        self._handle(ev.command(message.command_type, lambda: self._library.find(message.mission_id)))

    def _on_edit(self, request: Any, response: Any) -> Any:
        self._handle(request_of(request, self._library.find))
        answer = self._kernel.queue_answer
        response.success, response.message = answer.success, answer.message
        return response

    def _on_language(self, message: String) -> None:
        self._outputs.set_language(message.data)

    def _on_wheelchair(self, attached: bool) -> None:
        self._handle(ev.PassengerChanged(attached))

    def _on_door(self, message: BuildingRequest) -> None:
        self._doors.on_request(message.name, message.phase, self.steady_s())

    def on_emergency_stop(self) -> None:
        self._handle(ev.EmergencyStopBegan())

    def _tick(self) -> None:
        self._outputs.show_newcomers()
        self._navigation.poll()
        self._docking.poll(self._docking_state())
        self._handle(ev.Tick())
        missing = [item.topic.name for item in (self._pose, self._odom, self.safety_status_input) if not item.fresh()]
        self.set_health(not missing, ", ".join(missing) if missing else "ready for commands")

    def _handle(self, event: ev.Event) -> None:
        self._performer.handle(event, self._inputs(), self.steady_s())
        self.report.values |= {"state": self._kernel.record.state.value, "reason": self._outputs.reason}

    def _docking_state(self) -> str:
        return self._docking_status.latest.state if self._docking_status.fresh() else ""

    def _inputs(self) -> ev.Inputs:
        safety = self.safety_status_input
        plan, navigation = self._plan.latest, self._navigation_status.latest
        navigation_served = self._navigation.served()
        return ev.Inputs(
            pose=pose_from_msg(self._pose.latest.pose) if self._pose.fresh() else None,
            twist=twist_from_msg(self._odom.latest.twist.twist) if self._odom.fresh() else None,
            emergency_stop=self.emergency_stop,
            safety_known=safety.fresh(),
            faults=tuple(safety.latest.active_faults) if safety.fresh() else (),
            battery=self._charge(),
            planned=navigation_served and plan is not None and bool(plan.poses),
            navigation_served=navigation_served,
            navigation_text="" if navigation is None else navigation.data,
            docking_served=self._docking.served(),
            docking_state=self._docking_state(),
            door=self._doors.text(self.steady_s()),
            charging=self._battery.fresh() and self._battery.latest.power_supply_status == _CHARGING,
            manual=self._teleop.fresh(),
            setting_out=self._motion_warnings.active,
            clock_s=self.now_s(),
        )

    def _charge(self) -> float:
        """[0, 1], NaN = unknown. From the robot's summary if the battery's topic is stale."""
        if self._battery.fresh():
            return float(self._battery.latest.percentage)
        return float(self._robot_status.latest.battery_percent) / 100.0 if self._robot_status.fresh() else math.nan

    def safe_output(self) -> None:
        """Stops the ride, which is no longer supervised. The journal restores the mission, paused."""
        if self._kernel.under_way:
            self._outputs.cancel_goal(everything=True)
            self._docking.cancel()
        self._outputs.show(Display.OFF)
        self._journal.close()
