"""Node ``touch_ui``: a web page for riders and staff. Commands in, what they should know out."""

from __future__ import annotations

from functools import partial
from typing import Any

from robot_stack.contract import services, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.mission_library import mission_library
from robot_stack.core.runtime import recordings_dir, tell_touch_screen
from robot_stack.ros.node import StackNode, run
from robot_stack.ui import protocol as p
from robot_stack.ui import view
from robot_stack.ui.desk import named
from robot_stack.ui.nodes.audit_file import AuditFile
from robot_stack.ui.nodes.hub import Hub
from robot_stack.ui.nodes.inputs import RobotInputs
from robot_stack.ui.nodes.layers import Layers
from robot_stack.ui.nodes.mission_files import MissionFiles
from robot_stack.ui.nodes.operator_requests import Answer, OperatorRequest
from robot_stack.ui.nodes.outputs import Outputs
from robot_stack.ui.nodes.server import WebServer
from robot_stack.ui.nodes.site import background, cameras, pictures, recordings
from robot_stack.ui.params import TouchUiParams

# Files and folders are looked at less often than topics.
_SLOW_HZ = 0.5
_DIAGNOSTICS_HZ = 1.0
_RIDE_COMMANDS = {"pause": "PAUSE", "resume": "RESUME", "abort": "ABORT"}
# Layers that are made from the snapshot.
_SECTIONS = {
    p.Layer.PLAN: view.plan_section,
    p.Layer.MARKERS: view.marker_section,
    p.Layer.PEOPLE: view.people_section,
    p.Layer.DISPLAY: view.display_section,
}
_ENDS = ("COMPLETED", "ABORTED", "FAILED")


class TouchUiNode(StackNode):
    """The server's thread calls ``stop``, ``drive``, ``carry_out``, ``want`` and ``audit``."""

    def __init__(self) -> None:
        super().__init__("touch_ui", TouchUiParams)
        pages = self.params.pages
        self.prepare_bulk()
        self._audit = AuditFile(pages.history_entries)
        self._map, picture = background(pages.map)
        self._cameras = cameras()
        library = mission_library(pages.missions_folder, pages.own_missions_folder)
        self._missions = MissionFiles(library, load_docks().docks)
        self._recordings = recordings_dir(pages.recordings_folder)
        self._outputs = Outputs(self)
        self._reset = OperatorRequest(self, self.params.reset, services.SAFETY_RESET, self.params.reset.tries)
        self._clear = OperatorRequest(self, self.params.reset, services.CLEAR_EMERGENCY_STOP, 1)
        self._called = False
        self._ride_state = ""
        self._wanted: frozenset[p.Layer] = frozenset()
        self._hub = Hub(self.params, self)
        layers = Layers(self, pages, lambda: self._hub.awaited, self._send_frame)
        self._inputs = layers.inputs = RobotInputs(self, layers.callbacks)
        self._server = WebServer(self.params.server, self._hub, pictures(picture))
        tell_touch_screen(self._server.url)
        self.every_real(pages.state_hz, self._show)
        self.every_real(_DIAGNOSTICS_HZ, self._show_diagnostics)
        self.every_real(_SLOW_HZ, self._show_files)
        self.every(topics.UI_HEARTBEAT.nominal_rate_hz, self._beat)
        self._beat()

    # --- asked by pages, in the server's thread ----------------------------------------------------------------------

    def stop(self) -> None:
        self._outputs.stop()

    def drive(self, twist: Twist2) -> None:
        self._outputs.drive(twist)

    def carry_out(self, client: int, message: p.ClientMessage) -> None:
        self.call_soon(lambda: self._carry_out(client, message))

    def want(self, layers: frozenset[p.Layer]) -> None:
        self.call_soon(lambda: self._want(layers))

    def audit(self, who: str, what: str, outcome: str) -> None:
        self.call_soon(lambda: self._audit.add(who, what, outcome))

    # --- carried out in the node's own loop --------------------------------------------------------------------------

    def _carry_out(self, client: int, message: p.ClientMessage) -> None:
        match message:
            case p.Reset():
                self._outputs.ask_release()
                self._reset.ask(self._answer_of_monitor(client, message))
                return
            case p.ClearStop():
                self._clear.ask(self._answer_of_monitor(client, message), source=message.source)
                return
            case p.CheckMission() | p.SaveMission() | p.DeleteMission():
                self._edit(client, message)
                return
            case p.Start():
                self._outputs.command("START_MISSION", message.mission)
            case p.Ride():
                self._outputs.command(_RIDE_COMMANDS[message.t])
            case p.Pose():
                self._outputs.set_pose(Pose2(message.x, message.y, message.yaw))
            case p.Goal():
                self._outputs.go(Pose2(message.x, message.y, message.yaw))
            case p.CancelGoal():
                self._outputs.cancel_goal()
            case p.CallStaff():
                self._called = message.on
        self._answer(client, message.id, True)
        self._show()

    def _answer_of_monitor(self, client: int, message: p.ClientMessage) -> Answer:
        who = self._hub.who(client)

        def answer(granted: bool, why: str, detail: str) -> None:
            self._audit.add(who, f"{named(message)}: answered", "ok" if granted else f"{why}: {detail}")
            self._answer(client, message.id, granted, why, detail)

        return answer

    def _edit(self, client: int, message: p.CheckMission | p.SaveMission | p.DeleteMission) -> None:
        done = self._missions.edit(message)
        if not isinstance(message, p.CheckMission):
            self._audit.add(self._hub.who(client), named(message), done.why or "ok")
            self._show_files()
        self._server.call(
            partial(self._hub.answer, **done.told()), client, message.id, not done.why, done.why, done.detail
        )

    def _want(self, layers: frozenset[p.Layer]) -> None:
        self._wanted = layers
        self._inputs.want(layers)
        self._show()
        self._show_files()

    def _answer(self, client: int, message_id: int, ok: bool, why: str = "", detail: str = "") -> None:
        self._server.call(self._hub.answer, client, message_id, ok, why, detail)

    def _send_frame(self, layer: p.Layer, data: bytes) -> None:
        self._server.frame(layer, data)

    # --- told to pages -----------------------------------------------------------------------------------------------

    def _show(self) -> None:
        if not self._hub.pages:
            self._note_ride()
            return
        snapshot = self._inputs.snapshot(staff_called=self._called, driven_by_hand=self._hub.driving)
        self._note_ride()
        layers = {layer: section(snapshot) for layer, section in _SECTIONS.items() if layer in self._wanted}
        self._server.call(self._hub.push, view.sections(snapshot), layers)

    def _note_ride(self) -> None:
        """The history knows how rides ended as well as who asked for them."""
        ride = self._inputs.ride()
        state = ride.state if ride else ""
        if ride and state != self._ride_state and state in _ENDS and self._ride_state:
            self._audit.add("robot", f"mission {ride.mission_id}: {state}", ride.reason)
        self._ride_state = state

    def _show_diagnostics(self) -> None:
        layers: dict[p.Layer, Any] = {}
        if p.Layer.DIAGNOSTICS in self._wanted:
            layers[p.Layer.DIAGNOSTICS] = self._inputs.diagnostics()
        if p.Layer.STOP_SOURCES in self._wanted:
            layers[p.Layer.STOP_SOURCES] = self._inputs.stop_sources()
        if layers:
            self._server.call(self._hub.push, {}, layers)

    def _show_files(self) -> None:
        if not self._hub.pages:
            return
        layers: dict[p.Layer, Any] = {}
        if p.Layer.HISTORY in self._wanted:
            layers[p.Layer.HISTORY] = self._audit.section()
        if p.Layer.RECORDINGS in self._wanted:
            layers[p.Layer.RECORDINGS] = recordings(self._recordings)
        if p.Layer.MISSION_FILES in self._wanted:
            layers[p.Layer.MISSION_FILES] = self._missions.files_section()
        self._server.call(self._hub.push, {"missions": self._missions.section(), "site": self._site()}, layers)

    def _site(self) -> dict[str, Any]:
        pages, pad, footprint = self.params.pages, self.params.pad, self.robot.footprint
        return {
            "map": self._map,
            "language": pages.language,
            "staff_contact": pages.staff_contact,
            "footprint": {"front": footprint.front_m, "rear": footprint.rear_m, "width": footprint.width_m},
            "cameras": self._cameras,
            "pad": {"linear_mps": pad.linear_mps, "lateral_mps": pad.lateral_mps, "angular_radps": pad.angular_radps},
        }

    def _beat(self) -> None:
        """The safety monitor takes its absence for a screen that nobody can use."""
        pages = self._hub.connected
        if pages:
            self._outputs.beat()
        self.report.values |= {"address": self._server.url, "pages": str(pages), "audit": str(self._audit.path)}
        alive = self._server.alive()
        self.set_health(alive, f"serving {self._server.url}" if alive else "the web server has ended")

    def safe_output(self) -> None:
        """A finger on the pad drives no longer."""
        self._server.close()
        self._outputs.drive(Twist2(0.0, 0.0, 0.0))

    def destroy_node(self) -> None:
        tell_touch_screen(None)
        self._server.close()
        super().destroy_node()
        self._audit.close()


def main() -> None:
    run(TouchUiNode)
