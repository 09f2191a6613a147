"""docking_controller: the actions /docking/dock and /docking/undock, /docking/status, /docking/cmd_vel, the latch."""

from __future__ import annotations

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import frames, topics
from robot_stack.core.camera import mounting
from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.docking.controller import DockingController
from robot_stack.docking.latch import LatchCommand
from robot_stack.docking.nodes.attached_file import AttachedFile
from robot_stack.docking.nodes.corrections import CorrectionsFile
from robot_stack.docking.nodes.docking_actions import DockingActions
from robot_stack.docking.nodes.inputs import DockingInputs
from robot_stack.docking.nodes.latch_io import LatchIo
from robot_stack.docking.nodes.outputs import DockingOutputs
from robot_stack.docking.params import DockingParams
from robot_stack.docking.results import DockCode, Result, UndockCode
from robot_stack.docking.situation import Output, Situation
from robot_stack.middleware.motion_warning import MotionWarnings
from robot_stack.middleware.navigation_client import NavigationClient
from robot_stack.middleware.node import StackNode

_TICK_HZ = topics.DOCKING_CMD_VEL.nominal_rate_hz
_TICKS_PER_LATCH_STATUS = round(_TICK_HZ / topics.LATCH_STATUS.nominal_rate_hz)
_TICKS_PER_STATUS = round(_TICK_HZ / topics.DOCKING_STATUS.nominal_rate_hz)


class DockingControllerNode(StackNode):
    """Stores inputs in callbacks; one tick runs the kernel and executes its output."""

    def __init__(self) -> None:
        super().__init__("docking_controller", DockingParams)
        self._docks = load_docks()
        self._file = CorrectionsFile(self.params.corrections_file)
        self._corrections, problem = self._file.load()
        if problem:
            self.get_logger().error(f"stored corrections are not used: {problem}")
        cameras = {frame: mounting(self.robot, frame) for frame in (frames.FRONT_CAMERA, frames.REAR_CAMERA)}
        self._departure = Departure(load(DepartureParams, "departure"))
        self._motion_warnings = MotionWarnings(self, given=self._departure.announced)
        self._controller = DockingController(self.params, cameras, self._departure, self._corrections)
        self._latch = LatchIo(self, self.params.engine_poll_hz)
        self.at_end.callback(self._latch.close)
        self._navigation = NavigationClient(self, self._controller.on_navigation)
        self._outputs = DockingOutputs(self, self.params, self._navigation)
        self._attached = self.device(AttachedFile)
        self._recalled = False
        self._ticks = 0
        self._inputs = DockingInputs(self, self.params, self._controller)
        self._actions = DockingActions(self, self._begin_dock, self._begin_undock)
        self.every(_TICK_HZ, self._tick)

    # --- requests ----------------------------------------------------------------------------------------------------

    def _on_safety_status(self, message: SafetyStatus) -> None:
        was_stopped = self.emergency_stop
        super()._on_safety_status(message)
        if was_stopped and not self.emergency_stop:
            self._outputs.released()

    def on_emergency_stop(self) -> None:
        self._outputs.stand()

    def _begin_dock(self, dock_id: str, approach_only: bool) -> Result | None:
        dock = self._docks.docks.get(dock_id)
        if dock is None:
            return Result(DockCode.UNKNOWN_DOCK, f"no dock {dock_id!r}; there are {', '.join(self._docks.docks)}")
        return self._controller.dock(dock_id, dock, approach_only=approach_only)

    def _begin_undock(self, dock_id: str) -> Result | None:
        known = self._controller.dock_id
        if dock_id and known and dock_id != known:
            return Result(UndockCode.NOT_ATTACHED, f"docked at {known!r}, not at {dock_id!r}")
        return self._controller.undock(self._situation())

    # --- tick --------------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        self._navigation.poll()
        situation = self._situation()
        self._recall(situation)
        output = self._controller.tick(situation)
        self._motion_warnings.publish(self._departure.remaining_s)
        self._remember()
        self._publish_latch()
        self._latch.command(output.latch)
        self._outputs.act(output)
        self._ticks += 1
        if self._ticks % _TICKS_PER_STATUS == 0:
            self._outputs.publish_status(output, self._controller.tracker.visible_markers)
            self._outputs.publish_target(self._controller.target(situation.odom))
            self._actions.publish_feedback(output)
            self._report_state(output)
        self._end_jobs(output)

    def _situation(self) -> Situation:
        return self._inputs.situation(self._latch.inputs, navigation_served=self._navigation.served())

    def _recall(self, situation: Situation) -> None:
        """Restores the state once the latch can be read: by then a simulated world is known to be new or not."""
        if situation.latch.known and not self._recalled:
            self._recalled = True
            self._controller.recall(self._attached.load())
            station = self._attached.load_station()
            if station in self._docks.docks:
                self._controller.recall_station(station, self._docks.docks[station])
            elif station:
                self.get_logger().error(f"docked at {station!r} before the restart, which is no dock any more")

    def _publish_latch(self) -> None:
        """Published before the latch is commanded, so that subscribers know of the undocking before the latch opens."""
        attached = self._controller.attached
        if attached is not None:
            due = self._ticks % _TICKS_PER_LATCH_STATUS == 0
            self._outputs.latch(self._controller.closed, attached, self._controller.undocking, due=due)

    def _remember(self) -> None:
        attached = self._controller.attached
        problem = "" if attached is None else self._attached.save(attached, self._controller.station)
        if problem:
            self.get_logger().error(problem, throttle_duration_sec=1.0)

    def _end_jobs(self, output: Output) -> None:
        result = output.result
        if result is None and self._actions.cancel_requested:
            result = self._controller.cancel()
            self._outputs.command(ZERO_TWIST)
            self._latch.command(LatchCommand.HOLD)
        if result is None:
            return
        self.get_logger().info(f"ended: {result.code.name}{': ' if result.reason else ''}{result.reason}")
        self._actions.end(result)
        if self._controller.corrections != self._corrections:
            self._corrections = dict(self._controller.corrections)
            problem = self._file.save(self._corrections)
            if problem:
                self.get_logger().error(problem)

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        self._outputs.stand()
        self._navigation.cancel()

    def _report_state(self, output: Output) -> None:
        inputs = self._latch.inputs
        self.set_health(inputs.known, output.text if inputs.known else "waiting for the engine's inputs")
        self.report.values = {
            "state": output.state.value,
            "doing": output.text,
            "try": str(output.tries),
            "latch": f"closed={int(inputs.closed)} open={int(inputs.open)}" if inputs.known else "unknown",
            "latch problem": self._latch.problem,
            "learnt": ", ".join(f"{name} ({item.dockings})" for name, item in self._controller.corrections.items()),
        }
