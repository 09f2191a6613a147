"""Data for pages: the robot's state, the layers in use, responses."""

from __future__ import annotations

from typing import Any

from robot_stack.ui import protocol as p
from robot_stack.ui import view
from robot_stack.ui.audit import ends_ride
from robot_stack.ui.nodes.audit_file import AuditFile
from robot_stack.ui.nodes.hub import Hub
from robot_stack.ui.nodes.inputs import RobotInputs
from robot_stack.ui.nodes.lane_file import LaneFile
from robot_stack.ui.nodes.mission_files import MissionFiles
from robot_stack.ui.nodes.self_test import GuidedSelfTest
from robot_stack.ui.nodes.server import WebServer
from robot_stack.ui.nodes.site import Site
from robot_stack.ui.nodes.zone_file import ZoneFile

# Layers that are made from the snapshot.
_SECTIONS = {
    p.Layer.PLAN: view.plan_section,
    p.Layer.MARKERS: view.marker_section,
    p.Layer.PEOPLE: view.people_section,
    p.Layer.DISPLAY: view.display_section,
}


class Pages:
    """Sends to all pages alike, from the node's own loop; the server's thread forwards the data.

    staff_called: a rider has called staff.
    """

    def __init__(
        self,
        hub: Hub,
        server: WebServer,
        inputs: RobotInputs,
        history: AuditFile,
        missions: MissionFiles,
        site: Site,
        zones: ZoneFile,
        lanes: LaneFile,
        self_test: GuidedSelfTest,
    ) -> None:
        self._hub, self._server = hub, server
        self._inputs, self._history, self._missions, self._site = inputs, history, missions, site
        self._zones, self._lanes, self._self_test = zones, lanes, self_test
        self._wanted: frozenset[p.Layer] = frozenset()
        self._ride_state = ""
        self.staff_called = False

    def request_layers(self, layers: frozenset[p.Layer]) -> None:
        """Sets the layers in use."""
        self._wanted = layers
        self._inputs.request_layers(layers)
        self.show()
        self.show_files()

    def who(self, client: int) -> str:
        return self._hub.who(client)

    def answer(self, client: int, message_id: int, ok: bool, why: str = "", detail: str = "", **more: Any) -> None:
        self._server.call(lambda: self._hub.answer(client, message_id, ok, why, detail, **more))

    def show(self) -> None:
        if not self._hub.pages:
            self._note_ride()
            return
        snapshot = self._inputs.snapshot(staff_called=self.staff_called, driven_by_hand=self._hub.driving)
        self._note_ride()
        layers = {layer: section(snapshot) for layer, section in _SECTIONS.items() if layer in self._wanted}
        if p.Layer.SELF_TEST in self._wanted:
            layers[p.Layer.SELF_TEST] = self._self_test.section()
        self._server.call(self._hub.push, view.sections(snapshot), layers)

    def _note_ride(self) -> None:
        """Records in the history how rides ended."""
        ride = self._inputs.ride()
        state = ride.state if ride else ""
        if ride and ends_ride(self._ride_state, state):
            self._history.add("robot", f"mission {ride.mission_id}: {state}", ride.reason)
        self._ride_state = state

    def show_diagnostics(self) -> None:
        layers: dict[p.Layer, Any] = {}
        if p.Layer.DIAGNOSTICS in self._wanted:
            layers[p.Layer.DIAGNOSTICS] = self._inputs.diagnostics()
        if p.Layer.STOP_SOURCES in self._wanted:
            layers[p.Layer.STOP_SOURCES] = self._inputs.stop_sources()
        if layers:
            self._server.call(self._hub.push, {}, layers)

    def show_files(self) -> None:
        if not self._hub.pages:
            return
        layers: dict[p.Layer, Any] = {}
        if p.Layer.HISTORY in self._wanted:
            layers[p.Layer.HISTORY] = self._history.section()
        if p.Layer.RECORDINGS in self._wanted:
            layers[p.Layer.RECORDINGS] = self._site.recordings()
        if p.Layer.EVENTS in self._wanted:
            layers[p.Layer.EVENTS] = self._site.events()
        if p.Layer.MISSION_FILES in self._wanted:
            layers[p.Layer.MISSION_FILES] = self._missions.files_section()
        if p.Layer.ZONES in self._wanted:
            layers[p.Layer.ZONES] = self._zones.section() | {"lanes": self._lanes.section()}
        sections = {
            "missions": self._missions.section(),
            "site": self._site.section(),
            "self_test_age": self._self_test.summary(),
        }
        self._server.call(self._hub.push, sections, layers)
