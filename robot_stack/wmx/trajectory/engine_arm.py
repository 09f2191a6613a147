"""The arm on the motion engine: its link, its spline buffer, its stops and its gripper."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisSelection,
    CoreMotionErrorCode,
    ErrorCode,
)
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.link import EngineLink
from robot_stack.wmx.trajectory.arm import ArmState, Blind, arm_state
from robot_stack.wmx.trajectory.results import Fault
from robot_stack.wmx.trajectory.spline import ClampedSpline

_CHANNEL = 0
_STATUS, _BUFFER, _START = "engine status", "spline buffer", "starting the spline"
_STOP, _QUICK_STOP, _GRIPPER = "stop", "quick stop", "gripper output"
_BUFFER_RETRY_S = 1.0


class EngineArm:
    """Belongs to one thread. Axis j is joint j."""

    def __init__(self, link: EngineLink, n_joints: int, max_points: int) -> None:
        self._link = link
        self._n_joints = n_joints
        self._buffer_points = max_points + 1  # the present position comes before the goal's points
        self._buffered_connection = 0
        self._snapshot: StatusSnapshot = empty_snapshot()
        self._refusal: Fault | None = None

    # --- link --------------------------------------------------------------------------------------------------------

    def poll(self, now_s: float) -> str:
        """Keeps the link and its spline buffer. Returns what is missing, an empty text if nothing is."""
        if not self._link.poll(now_s):
            return self._link.text
        if self._buffered_connection != self._link.connections:
            if not self._link.due(_BUFFER, now_s, _BUFFER_RETRY_S):
                return self._link.refusal(_BUFFER, self._link.text)
            problem = self._ask(_BUFFER, self._create_buffer, _advanced_text)
            if problem is not None:
                return problem.text
            self._buffered_connection = self._link.connections
        return ""

    def read(self) -> ArmState | Blind:
        """The status at this moment."""
        problem = self._ask(_STATUS, self._read_status, _base_text)
        if problem is not None:
            return Blind(problem, gone=self._link.engine is None)
        return arm_state(self._snapshot, self._n_joints)

    def close(self) -> None:
        self._link.close()

    # --- motion ------------------------------------------------------------------------------------------------------

    def start(self, spline: ClampedSpline) -> Fault | None:
        if self._buffered_connection != self._link.connections:
            text = self._link.refusal(_BUFFER, "the spline buffer is not there yet")
            return Fault(CoreMotionErrorCode.ChannelBufferMemoryNotAllocated, text)
        command = AdvMotion_PointTimeSplineCommand(self._n_joints, list(range(self._n_joints)))
        points = [AdvMotion_SplinePoint(row) for row in spline.positions.tolist()]
        times_ms = (1e3 * spline.times_s).tolist()
        return self._ask(
            _START,
            lambda engine: engine.advanced_motion.advMotion.StartCSplinePos_PointTime(
                _CHANNEL, command, len(points), points, times_ms
            ),
            _advanced_text,
        )

    def stop(self) -> Fault | None:
        axes = self._axes()
        return self._ask(_STOP, lambda engine: engine.core_motion.motion.Stop_AxisSel(axes), _motion_text)

    def quick_stop(self) -> Fault | None:
        axes = self._axes()
        return self._ask(
            _QUICK_STOP, lambda engine: engine.core_motion.motion.ExecQuickStop_AxisSel(axes), _motion_text
        )

    # --- gripper -----------------------------------------------------------------------------------------------------

    def set_output(self, byte: int, bit: int, value: int) -> Fault | None:
        """Sets an output bit and reads it back. A bus that is down carries it nowhere."""
        status = self.read()
        if isinstance(status, Blind):
            return status.fault
        if not status.communicating:
            return Fault(ErrorCode.CommNotStarted, f"{_GRIPPER}: no communication with the drives")

        def set_and_read_back(engine: MotionEngine) -> int:
            code = engine.io.SetOutBit(byte, bit, value)
            if code:
                return code
            code, found = engine.io.GetOutBit(byte, bit)
            return code or (ErrorCode.PyNone if found == value else ErrorCode.SystemError)

        return self._ask(_GRIPPER, set_and_read_back, _io_text)

    # --- details -----------------------------------------------------------------------------------------------------

    def _axes(self) -> AxisSelection:
        return AxisSelection.of(*range(self._n_joints))

    def _read_status(self, engine: MotionEngine) -> int:
        code, snapshot = engine.read_status()
        if not code and snapshot.n_axes < self._n_joints:
            return ErrorCode.AxisOutOfRange
        self._snapshot = snapshot
        return code

    def _create_buffer(self, engine: MotionEngine) -> int:
        """A buffer that an earlier server left behind is used if it is large enough."""
        splines = engine.advanced_motion.advMotion
        code = splines.CreateSplineBuffer(_CHANNEL, self._buffer_points)
        if code != CoreMotionErrorCode.ChannelBufferMemoryAlreadyAllocated:
            return code
        code, points = splines.GetSplineBufferPoints(_CHANNEL)
        if code or points >= self._buffer_points:
            return code
        return splines.FreeSplineBuffer(_CHANNEL) or splines.CreateSplineBuffer(_CHANNEL, self._buffer_points)

    def _ask(
        self, what: str, request: Callable[[MotionEngine], int], text: Callable[[MotionEngine, int], str]
    ) -> Fault | None:
        """One request; the refusal carries the engine's code and the text of the module that refused."""
        refusal = Fault(ErrorCode.IMLibIsNotRunning, f"{what}: {self._link.text}")

        def noted(engine: MotionEngine) -> int:
            nonlocal refusal
            code = request(engine)
            if code:
                refusal = Fault(int(code), f"{what}: {text(engine, code)} (error {int(code)})")
            return code

        return None if self._link.ask(what, noted) else refusal


def _base_text(engine: MotionEngine, code: int) -> str:
    return engine.api.ErrorToString(code)


def _motion_text(engine: MotionEngine, code: int) -> str:
    return engine.core_motion.ErrorToString(code)


def _advanced_text(engine: MotionEngine, code: int) -> str:
    return engine.advanced_motion.ErrorToString(code)


def _io_text(engine: MotionEngine, code: int) -> str:
    return engine.io.ErrorToString(code)
