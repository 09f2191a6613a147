"""Node ``ehmi_bridge``: sends /ehmi/state_command to the display on the serial line, publishes /ehmi/status."""

from __future__ import annotations

from custom_msgs.msg import EHMIState, EHMIStatus
from robot_stack.contract import topics
from robot_stack.contract.display import Display
from robot_stack.core.runtime import runtime_dir
from robot_stack.ehmi.choice import Safety, Situation, after_mission_manager, choose
from robot_stack.ehmi.link import LinkStatus, Shown
from robot_stack.ehmi.nodes.serial_port import SerialPort
from robot_stack.ehmi.params import EhmiParams
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wheelchair import WheelchairInput

_LAST_WORD_S = 0.5  # of the way out


class EhmiBridgeNode(StackNode):
    def __init__(self) -> None:
        super().__init__("ehmi_bridge", EhmiParams)
        self._asked: int | None = None
        self._language, self._volume = self.params.language, self.params.volume
        self._mission_managers = 0
        self._leaving = False
        self._status = self.advertise(topics.EHMI_STATUS)
        self._wheelchair = WheelchairInput(self)
        self._docking = self.subscribe(topics.DOCKING_STATUS)
        self._mission = self.subscribe(topics.MISSION_STATUS)
        self.subscribe(topics.EHMI_STATE_COMMAND, self._on_command)
        self._shown = self._wanted()
        # An absolute path replaces the runtime folder.
        self._port_path = str(runtime_dir() / self.params.port)
        self._port = self.device(SerialPort, self._port_path, self.params.baud_rate, self.params.link, self._shown)
        self.at_end.callback(self._port.close)
        self.every(self.params.tick_rate_hz, self._tick)
        self.every(topics.EHMI_STATUS.nominal_rate_hz, self._publish)

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_command(self, message: EHMIState) -> None:
        try:
            Shown(message.state_num, message.language, message.volume).commands()
        except ValueError as error:
            self.get_logger().error(f"/ehmi/state_command refused: {error}", throttle_duration_sec=1.0)
            return
        self._asked, self._language, self._volume = message.state_num, message.language, message.volume
        self._show()

    def on_emergency_stop(self) -> None:
        self._show()

    def _tick(self) -> None:
        self._watch_mission_manager()
        self._show()
        link = self._port.status()
        self.set_health(link.linked, link.text)
        self._report(link)

    def _watch_mission_manager(self) -> None:
        """Drops the request of a mission manager that has ended."""
        before, self._mission_managers = self._mission_managers, self.count_publishers(topics.MISSION_STATUS.name)
        if before and not self._mission_managers:
            self._asked = after_mission_manager(self._asked)

    # --- outputs -----------------------------------------------------------------------------------------------------

    def _wanted(self) -> Shown:
        state = Display.OFF if self._leaving else choose(self._situation())
        return Shown(int(state), self._language, self._volume)

    def _situation(self) -> Situation:
        mission, docking = self._mission.latest, self._docking.latest
        return Situation(
            emergency=self.emergency_stop,
            safety=self._safety(),
            asked=self._asked,
            passenger=self._wheelchair.attached,
            mission=mission.state if mission is not None and self._mission_managers else "",
            docking=docking.state if docking is not None and self._docking.fresh() else "",
        )

    def _safety(self) -> Safety:
        if not self.safety_status_input.received:
            return Safety.UNKNOWN
        silent = self.safety_status_input.age_s() > self.params.safety_silence_s
        return Safety.SILENT if silent else Safety.FRESH

    def _show(self) -> None:
        wanted = self._wanted()
        if wanted != self._shown:
            self._shown = wanted
            self._port.show(wanted)

    def _publish(self) -> None:
        link = self._port.status()
        acknowledged = EHMIStatus.NO_STATE if link.acknowledged_state is None else link.acknowledged_state
        message = EHMIStatus(linked=link.linked, acknowledged_state=acknowledged, firmware_fault=link.fault)
        message.header.stamp = self.stamp()
        self._status.publish(message)

    def _report(self, link: LinkStatus) -> None:
        self.report.values |= {
            "port": self._port_path,
            "shown": Display(self._shown.state).name,
            "asked": "nothing" if self._asked is None else Display(self._asked).name,
            "state to acknowledge": f"{1e3 * link.state_to_ack_s:.1f} ms",
            "refused lines": ", ".join(f"{count} {why}" for why, count in self._port.rejected().items()) or "none",
        }

    def safe_output(self) -> None:
        """Switches the display off with the robot, if the link still works."""
        self._leaving = True
        self._show()
        self.port.wait_until(lambda: self._port.status().acknowledged_state == Display.OFF, _LAST_WORD_S)
