"""The node of the safety monitor: messages to the kernel, its verdict to ``/safety/status`` and the speed limit."""

from __future__ import annotations

from typing import Any

from std_msgs.msg import Bool

from robot_stack.contract import services, topics
from robot_stack.core.limits import SafetyLimit
from robot_stack.core.node_record import Heartbeats
from robot_stack.core.runtime import state_dir, state_shadow_dir
from robot_stack.core.stop_presence import describe_presence
from robot_stack.middleware.node import StackNode
from robot_stack.safety.arbiter import Verdict
from robot_stack.safety.latch_store import LatchStore
from robot_stack.safety.monitor import Memory, SafetyMonitor
from robot_stack.safety.nodes.computer_inputs import ComputerInputs
from robot_stack.safety.nodes.engine_input import EngineInput
from robot_stack.safety.nodes.outputs import SafetyOutputs
from robot_stack.safety.nodes.robot_inputs import RobotInputs
from robot_stack.safety.nodes.surroundings_inputs import SurroundingsInputs
from robot_stack.safety.params import SafetyParams

LATCH_FOLDER, LATCH_FILE, LATCH_WITNESS = "safety", "safety_latch", ".latch"


class SafetyMonitorNode(StackNode):
    """Judges at ``tick_hz``, and at once on /emergency_stop and after a reset."""

    def __init__(self) -> None:
        super().__init__("safety_monitor", SafetyParams)
        shadow = state_shadow_dir()
        shadow.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._store = self.device(
            LatchStore,
            state_dir() / LATCH_FOLDER,
            shadow / LATCH_FILE,
            state_dir().with_suffix(LATCH_WITNESS),
            self.params.latch_write_s,
            self.worker("latch"),
            self.monotonic_s,
        )
        self.at_end.callback(self._store.close)
        memory = self._store.load()
        self._store.save(memory)  # creates the copies at the first start, and repairs damaged ones
        self._monitor = self._new_monitor(memory)
        self._ticking = False
        self._verdict: Verdict | None = None
        self._outputs = SafetyOutputs(self)
        self._heartbeats = Heartbeats(self.params.expected_processes)
        RobotInputs(self, lambda: self._monitor.observation, self._on_passenger)
        SurroundingsInputs(self, lambda: self._monitor.observation, self.params)
        ComputerInputs(self, lambda: self._monitor.observation)
        self.serve(services.SAFETY_RESET, self._on_reset)
        self.serve(services.CLEAR_EMERGENCY_STOP, self._on_clear)
        self.every(self.params.tick_hz, self._tick)
        self.every(topics.SAFETY_STATUS.nominal_rate_hz, self._publish_status)
        self.every(topics.VELOCITY_LIMIT.nominal_rate_hz, self._repeat_limit)
        self._report_rows = {"rows": ", ".join(self._monitor.rows)}
        self._engine = EngineInput(self, 2.0 * self.params.tick_hz)
        self.at_end.callback(self._engine.close)
        self._engine.start()

    def _new_monitor(self, memory: Memory) -> SafetyMonitor:
        return SafetyMonitor(self.params, self.robot, memory, self.steady_s())

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_emergency_stop(self, message: Bool) -> None:
        super()._on_emergency_stop(message)
        self._monitor.observation.emergency_stop(message.data, self.steady_s())
        self._step()

    def _on_passenger(self, attached: bool) -> None:
        self._monitor.observation.chair.on_passenger(attached)
        self._step()

    # --- verdict -----------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        if not self._ticking:
            self._begin()
        self._step()

    def _begin(self) -> None:
        """Starts the start-up grace: under /clock no time has passed before the first tick."""
        self._ticking = True
        self._monitor = self._new_monitor(self._monitor.memory)
        if self.emergency_stop_input.latest is not None:
            self._monitor.observation.emergency_stop(self.emergency_stop_input.latest.data, self.steady_s())

    def _step(self) -> None:
        self._monitor.observation.latch_problem = self._store.problem()
        for process in self._heartbeats.new():
            self._monitor.observation.heartbeat(process, self.steady_s())
        now_s = self._look_at_engine()
        self._act(self._monitor.step(now_s))

    def _look_at_engine(self) -> float:
        self._engine.catch_up()
        now_s = self.steady_s()
        self._monitor.observation.engine(self._engine.reading, now_s)
        return now_s

    def _on_reset(self, _: Any, response: Any) -> Any:
        answer = self._monitor.reset(self._look_at_engine())
        self.get_logger().info(f"reset: {answer.message}")
        self._step()
        response.success, response.message = answer.success, answer.message
        return response

    def _on_clear(self, request: Any, response: Any) -> Any:
        answer = self._monitor.clear(request.source, self.steady_s())
        self.get_logger().info(f"clear {request.source!r}: {answer.message}")
        self._step()
        response.success, response.message = answer.success, answer.message
        return response

    def _act(self, verdict: Verdict) -> None:
        # Before publishing: a crash in between must not lose a latch.
        self._store.save_if_new(self._monitor.memory)
        before, self._verdict = self._verdict, verdict
        if before is None or (before.state, before.faults) != (verdict.state, verdict.faults):
            self._outputs.log_changes(before, verdict, self._monitor.details)
            self.set_health(True, " ".join([verdict.state.name, *verdict.faults]))
            self._publish_status()
        if before is None or before.limit != verdict.limit:
            self._outputs.limit(verdict.limit)

    def _publish_status(self) -> None:
        if self._verdict is None:
            return
        self._outputs.status(self._verdict, self._monitor.nearest_obstacle_m, self._monitor.button_pressed)
        self._report_sources()

    def _report_sources(self) -> None:
        """Reports the standing presses, and those whose source is gone, to the operator."""
        self.report.values = self._report_rows | describe_presence(self._monitor.pressed_by(self.steady_s()))

    def _repeat_limit(self) -> None:
        if self._verdict is not None:
            self._outputs.limit(self._verdict.limit)

    def safe_output(self) -> None:
        """Without a monitor the robot must not drive."""
        self._outputs.limit(SafetyLimit(0.0, 0.0, ("NODE_DEAD",)))
