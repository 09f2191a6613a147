"""Devices of the nodes on the scheduler: a counterpart of each device in the same process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.ehmi.nodes.serial_port import SerialPort
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from robot_stack.middleware.port import Port
from robot_stack.recording.opening import open_black_box
from robot_stack.system_monitor.nodes.computer_reader import ProcessReader, configured_reader
from robot_stack.ui.nodes.hub import Hub
from robot_stack.ui.nodes.server import WebServer
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.device_opener import PromptOpener, ThreadedOpener
from robot_stack.wmx.view import EngineView
from sim.computer.computer import SimComputer
from sim.ehmi.line import DisplayLine
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.port import SimPort
from sim.scheduler.scheduler import Scheduler
from sim.stack.black_box import ScheduledBlackBox
from sim.stack.computer import NoProcesses, ScheduledComputer, ScheduledReader
from sim.stack.disk import ScheduledDisk
from sim.stack.display import Cable, ScheduledDisplay, ScheduledSerialPort
from sim.stack.engine import ScheduledView
from sim.stack.fleet import ScheduledBroker
from sim.stack.screen import OpenPage, ScheduledHub, ScheduledServer


class StackDevices:
    """Registers the counterparts with the scheduler.

    open_engine: opens a device on the motion engine for the node of a port, or raises EngineError. lose_power: called
    when a torn write has ended. server: None until touch_ui serves.
    """

    def __init__(
        self, scheduler: Scheduler, open_engine: Callable[[Port], MotionEngine], lose_power: Callable[[], object]
    ) -> None:
        def after(delay_s: float, callback: Callable[[], None]) -> None:
            scheduler.at(scheduler.now_ns + round(delay_s * NANOSECONDS), callback)

        self.computer = ScheduledComputer(lambda: scheduler.now_s)
        self.cable = Cable(after)
        self.disk = ScheduledDisk()
        self.broker = ScheduledBroker(runs)
        self.server: ScheduledServer | None = None
        self._screen: OpenPage | None = None
        self._open_engine = open_engine
        devices: dict[Any, Callable[..., Any]] = scheduler.devices
        devices[ThreadedOpener] = lambda port, _: PromptOpener(lambda: open_engine(port))
        devices[EngineView] = self._engine_view
        devices[SerialPort] = lambda port, _path, _baud, params, wanted: ScheduledSerialPort(
            port, self.cable, params, wanted
        )
        devices[DisplayLine] = lambda port, params, link: ScheduledDisplay(port, self.cable, params, link)
        devices[SimComputer] = lambda port, *arguments: self.computer.power_on(*arguments)
        devices[configured_reader] = lambda port, _: ScheduledReader(self.computer)
        devices[ProcessReader] = lambda port, _: NoProcesses()
        devices[Hub] = _hub
        devices[MqttLink] = self.broker.connect
        devices[open_black_box] = ScheduledBlackBox().open
        self.disk.register(devices, scheduler, lose_power)
        devices[WebServer] = self._web_server

    def _engine_view(self, port: Port, _: str, poll_hz: float, on_status: Callable[..., None]) -> ScheduledView:
        return ScheduledView(port, lambda: self._open_engine(port), poll_hz, on_status)

    def _switch_screen(self, shown: bool) -> None:
        """A page on the robot's own screen opens or closes."""
        if self._screen is not None:
            self._screen.close()
        self._screen = self.server.open_page() if shown and self.server is not None else None

    def _web_server(self, port: Port, _: Any, hub: ScheduledHub, __: Any) -> ScheduledServer:
        self.server = ScheduledServer(port, hub)
        self.computer.screen.on_change = self._switch_screen
        return self.server


def runs(port: Port) -> bool:
    """True if the process of the node of this port runs."""
    assert isinstance(port, SimPort)
    return port.life.alive and not port.life.hung


def _hub(port: Port, *arguments: Any) -> ScheduledHub:
    hub = ScheduledHub(*arguments)
    hub.port = port
    return hub
