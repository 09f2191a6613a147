"""The node of the safety monitor: messages to the kernel, its verdict to ``/safety/status`` and the speed limit."""

from __future__ import annotations

from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState, CameraInfo, Imu, JointState
from std_msgs.msg import Bool, Float32

from custom_msgs.msg import DockingStatus, EmergencyStopSource, SafetyStatus, VelocityLimit
from robot_stack.contract import frames, services, topics
from robot_stack.core.limits import STANDSTILL, SpeedLimit
from robot_stack.core.node_record import Heartbeats
from robot_stack.core.runtime import runtime_dir, state_dir
from robot_stack.core.stop_presence import describe_presence
from robot_stack.ros.node import StackNode, run
from robot_stack.safety.arbiter import Verdict
from robot_stack.safety.button import Contact, read_contact
from robot_stack.safety.inputs import Axis, DriveReading, ImuSample
from robot_stack.safety.latch_store import LatchStore
from robot_stack.safety.monitor import Memory, SafetyMonitor
from robot_stack.safety.nodes.computer_inputs import ComputerInputs
from robot_stack.safety.nodes.surroundings_inputs import SurroundingsInputs
from robot_stack.safety.observation import CAMERAS
from robot_stack.safety.params import SafetyParams
from robot_stack.safety.stop_sources import SourceReport
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.view import EngineView

LATCH_FOLDER, LATCH_FILE = "safety", "safety_latch"


class SafetyMonitorNode(StackNode):
    """Judges at ``tick_hz``, and at once on /emergency_stop and after a reset."""

    def __init__(self) -> None:
        super().__init__("safety_monitor", SafetyParams)
        self._store = LatchStore(state_dir() / LATCH_FOLDER, runtime_dir() / LATCH_FILE, self.params.latch_write_s)
        self._stored = self._store.load()
        self._store.save(self._stored)  # makes the copies of the first start, and mends damaged ones
        self._monitor = self._new_monitor(self._stored)
        self._ticking = False
        self._verdict: Verdict | None = None
        self._reading: DriveReading | None = None
        self._status = self.advertise(topics.SAFETY_STATUS)
        self._limit = self.advertise(topics.VELOCITY_LIMIT)
        self.subscribe(topics.EMERGENCY_STOP_SOURCES, self._on_stop_source)
        self._joints = self.subscribe(topics.JOINT_STATES, self._on_joint_states)
        self._imu = self.subscribe(topics.IMU, self._on_imu)
        self._pose = self.subscribe(topics.CURRENT_POSE, self._on_pose)
        self._quality = self.subscribe(topics.LOCALIZATION_QUALITY, self._on_quality)
        self._battery = self.subscribe(topics.BATTERY_STATE, self._on_battery)
        self._heartbeats = Heartbeats(self.params.expected_processes)
        self.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        self.subscribe(topics.DOCKING_STATUS, self._on_docking)
        for camera in CAMERAS:
            self.subscribe(camera, partial(self._on_camera, camera.name))
        SurroundingsInputs(self, lambda: self._monitor.observation, self.params)
        ComputerInputs(self, lambda: self._monitor.observation)
        self.serve(services.SAFETY_RESET, self._on_reset)
        self.serve(services.CLEAR_EMERGENCY_STOP, self._on_clear)
        self.every(self.params.tick_hz, self._tick)
        self.every(topics.SAFETY_STATUS.nominal_rate_hz, self._publish_status)
        self.every(topics.VELOCITY_LIMIT.nominal_rate_hz, self._repeat_limit)
        self._report_rows = {"rows": ", ".join(self._monitor.rows)}
        self._view = EngineView("safety_monitor", 2.0 * self.params.tick_hz, self._on_engine)
        self._view.start()

    def _new_monitor(self, memory: Memory) -> SafetyMonitor:
        return SafetyMonitor(self.params, self.robot, memory, self.steady_s())

    # --- inputs ------------------------------------------------------------------------------------------------------

    def _on_emergency_stop(self, message: Bool) -> None:
        super()._on_emergency_stop(message)
        self._monitor.observation.emergency_stop(message.data, self.steady_s())
        self._step()

    def _on_stop_source(self, message: EmergencyStopSource) -> None:
        report = SourceReport(message.name, message.pid, message.presses, message.pressed)
        self._monitor.observation.stop_source(report, self.steady_s())

    def _on_passenger(self, message: Bool) -> None:
        self._monitor.passenger = message.data
        self._step()

    def _on_joint_states(self, message: JointState) -> None:
        received_s = self._joints.received_s
        self._monitor.observation.joint_states(message.name, message.position, message.velocity, received_s)

    def _on_imu(self, message: Imu) -> None:
        force, rate = message.linear_acceleration, message.angular_velocity
        sample = ImuSample(force.x, force.y, force.z, rate.x, rate.y, rate.z)
        self._monitor.observation.imu(sample, self._imu.received_s)

    def _on_pose(self, message: PoseStamped) -> None:
        self._monitor.observation.pose(message.pose.position.x, message.pose.position.y, self._pose.received_s)

    def _on_quality(self, message: Float32) -> None:
        self._monitor.observation.quality(message.data, self._quality.received_s)

    def _on_battery(self, message: BatteryState) -> None:
        self._monitor.observation.battery(message.percentage, self._battery.received_s)

    def _on_docking(self, message: DockingStatus) -> None:
        self._monitor.observation.docking(message.state, self.steady_s())

    def _on_camera(self, topic: str, _: CameraInfo) -> None:
        self._monitor.observation.camera(topic, self.steady_s())

    def _on_engine(self, status: StatusSnapshot | None) -> None:
        """In the thread of the view: one assignment, which the next step picks up."""
        contact = read_contact(status, self.robot.estop_input_byte, self.robot.estop_input_bit)
        self._reading = None if status is None else _reading(status, contact)

    # --- verdict -----------------------------------------------------------------------------------------------------

    def _tick(self) -> None:
        if not self._ticking:
            self._begin()
        self._step()

    def _begin(self) -> None:
        """Under /clock the time before the first tick was none: the start-up grace begins now."""
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
        self._view.catch_up()
        now_s = self.steady_s()
        self._monitor.observation.engine(self._reading, now_s)
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
        self._remember()
        before, self._verdict = self._verdict, verdict
        if before is None or (before.state, before.faults) != (verdict.state, verdict.faults):
            self._log_verdict(before, verdict)
            self._publish_status()
        if before is None or (before.limit, before.reason) != (verdict.limit, verdict.reason):
            self._publish_limit(verdict.limit, verdict.reason)

    def _remember(self) -> None:
        """Before anything is published: a crash in between must not forget a latch."""
        memory = self._monitor.memory
        if memory != self._stored:
            self._store.save(memory)
            self._stored = memory

    def _log_verdict(self, before: Verdict | None, verdict: Verdict) -> None:
        known, details = set(before.faults if before else ()), self._monitor.details
        for code in verdict.faults:
            if code not in known:
                self.get_logger().warning(f"{code}: {details[code]}")
        for code in known.difference(verdict.faults):
            self.get_logger().info(f"{code}: cleared")
        self.set_health(True, " ".join([verdict.state.name, *verdict.faults]))

    def _publish_status(self) -> None:
        if self._verdict is None:
            return
        message = SafetyStatus(
            safety_state=self._verdict.state.name,
            active_faults=list(self._verdict.faults),
            min_obstacle_distance=self._monitor.nearest_obstacle_m,
            emergency_stop_active=self._monitor.button_pressed,
        )
        message.header.stamp, message.header.frame_id = self.stamp(), frames.BASE_LINK
        self._status.publish(message)
        self._report_sources()

    def _report_sources(self) -> None:
        """An operator must be able to see whose press stands, and which nobody is there to release."""
        self.report.values = self._report_rows | describe_presence(self._monitor.pressed_by(self.steady_s()))

    def _publish_limit(self, limit: SpeedLimit, reason: str) -> None:
        message = VelocityLimit(
            max_linear_velocity=limit.linear_mps, max_angular_velocity=limit.angular_radps, reason=reason
        )
        message.header.stamp, message.header.frame_id = self.stamp(), frames.BASE_LINK
        self._limit.publish(message)

    def _repeat_limit(self) -> None:
        if self._verdict is not None:
            self._publish_limit(self._verdict.limit, self._verdict.reason)

    def safe_output(self) -> None:
        """Nobody drives without a monitor."""
        self._publish_limit(STANDSTILL, "NODE_DEAD")

    def destroy_node(self) -> None:
        self._view.close()
        self._store.close()
        super().destroy_node()


def _reading(status: StatusSnapshot, button: Contact) -> DriveReading:
    flags = zip(status.servo_on, status.amp_alarm, status.following_error_alarm, strict=True)
    axes = tuple(Axis(bool(on), bool(alarm), bool(error)) for on, alarm, error in flags)
    return DriveReading(status.communicating, status.cycle_counter, axes, button)


def main() -> None:
    run(SafetyMonitorNode)
