"""Node ``touch_ui``: a web page for riders and staff. Receives commands, sends the state."""

from __future__ import annotations

from robot_stack.contract import topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Twist2
from robot_stack.core.keepout import load_keepout
from robot_stack.core.mission_library import mission_library
from robot_stack.core.runtime import tell_touch_screen
from robot_stack.middleware.node import StackNode
from robot_stack.ui import protocol as p
from robot_stack.ui.nodes.audit_file import AuditFile
from robot_stack.ui.nodes.hub import Hub
from robot_stack.ui.nodes.inputs import RobotInputs
from robot_stack.ui.nodes.lane_file import LaneFile
from robot_stack.ui.nodes.layers import Layers
from robot_stack.ui.nodes.mission_files import MissionFiles
from robot_stack.ui.nodes.outputs import Outputs
from robot_stack.ui.nodes.page_commands import PageCommands
from robot_stack.ui.nodes.pages import Pages
from robot_stack.ui.nodes.self_test import GuidedSelfTest
from robot_stack.ui.nodes.server import WebServer
from robot_stack.ui.nodes.site import Site
from robot_stack.ui.nodes.zone_file import ZoneFile
from robot_stack.ui.params import TouchUiParams

# Files and folders are polled less often than topics.
_SLOW_HZ = 0.5
_DIAGNOSTICS_HZ = 1.0


class TouchUiNode(StackNode):
    """The server's thread calls ``stop``, ``drive``, ``carry_out``, ``request_layers`` and ``audit``."""

    def __init__(self) -> None:
        super().__init__("touch_ui", TouchUiParams)
        pages = self.params.pages
        self.prepare_bulk()
        self._audit = AuditFile(pages.history_entries)
        site = Site(self.params, self.robot.footprint)
        library = mission_library(pages.missions_folder, pages.own_missions_folder)
        missions = MissionFiles(library, load_docks().docks, load_keepout(pages.map, self.robot))
        zones = ZoneFile(pages.map)
        lanes = LaneFile(pages.map, self.robot, zones.zones)
        self._outputs = Outputs(self)
        self._hub = self.device(Hub, self.params, self, self.monotonic_s)
        layers = Layers(self, pages, lambda: self._hub.awaited, self._send_frame)
        inputs = layers.inputs = RobotInputs(self, layers.callbacks)
        self._server = self.device(WebServer, self.params.server, self._hub, site.pictures)
        self_test = GuidedSelfTest(self, self.params, inputs, self._outputs, self._audit, lambda: self._hub.testers)
        self._pages = Pages(self._hub, self._server, inputs, self._audit, missions, site, zones, lanes, self_test)
        self._commands = PageCommands(
            self, self.params.reset, self._outputs, self._pages, self._audit, missions, zones, lanes, self_test
        )
        tell_touch_screen(self._server.url)
        self.every_real(pages.state_hz, self_test.tick)
        self.every_real(pages.state_hz, self._pages.show)
        self.every_real(_DIAGNOSTICS_HZ, self._pages.show_diagnostics)
        self.every_real(_SLOW_HZ, self._pages.show_files)
        self.every_real(_SLOW_HZ, self._commands.poll)
        self.every(topics.UI_HEARTBEAT.nominal_rate_hz, self._beat)
        self._beat()

    # --- called by pages, in the server's thread ---------------------------------------------------------------------

    def stop(self) -> None:
        self._outputs.stop()

    def drive(self, twist: Twist2) -> None:
        self._outputs.drive(twist)

    def carry_out(self, client: int, message: p.ClientMessage) -> None:
        self.call_soon(lambda: self._commands.carry_out(client, message))

    def request_layers(self, layers: frozenset[p.Layer]) -> None:
        self.call_soon(lambda: self._pages.request_layers(layers))

    def audit(self, who: str, what: str, outcome: str) -> None:
        self.call_soon(lambda: self._audit.add(who, what, outcome))

    # --- in the node's own loop --------------------------------------------------------------------------------------

    def on_emergency_stop(self) -> None:
        self._hub.stopped()

    def _send_frame(self, layer: p.Layer, data: bytes) -> None:
        self._server.call(self._hub.frame, layer, data)

    def _beat(self) -> None:
        """The safety monitor takes a missing beat for an unusable screen."""
        pages = self._hub.connected
        if pages:
            self._outputs.beat()
        self.report.values |= {"address": self._server.url, "pages": str(pages), "audit": str(self._audit.path)}
        alive = self._server.alive()
        self.set_health(alive, f"serving {self._server.url}" if alive else "the web server has ended")

    def safe_output(self) -> None:
        """Stops the server and publishes a zero command of the pad."""
        self._server.close()
        self._outputs.drive(Twist2(0.0, 0.0, 0.0))

    def destroy_node(self) -> None:
        tell_touch_screen(None)
        self._server.close()
        super().destroy_node()
        self._audit.close()
