"""The arm on the motion engine: its session, its spline buffer, its stops and its gripper."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisSelection,
    CoreMotionErrorCode,
    ErrorCode,
    OperationState,
)
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.session import EngineSession
from robot_stack.wmx.trajectory.arm import ArmState, Blind, arm_state
from robot_stack.wmx.trajectory.results import Fault
from robot_stack.wmx.trajectory.spline import ClampedSpline

_CHANNEL = 0
_STATUS, _BUFFER, _START = "engine status", "spline buffer", "starting the spline"
_STOP, _QUICK_STOP, _GRIPPER = "stop", "quick stop", "gripper output"
_BUFFER_RETRY_S = 1.0
_LEFT_MOVING = "stopping a trajectory whose server has ended"


class EngineArm:
    """Belongs to one thread. Axis j is joint j."""

    def __init__(self, session: EngineSession, n_joints: int, max_points: int) -> None:
        self._session = session
        self._n_joints = n_joints
        self._buffer_points = max_points + 1  # the present position precedes the goal's points
        self._buffered_connection = 0
        self._waiting = session.text
        self._snapshot: StatusSnapshot = empty_snapshot()

    # --- session -----------------------------------------------------------------------------------------------------

    def poll(self, now_s: float) -> str:
        """Maintains the session and its spline buffer. Returns what is missing, an empty text if nothing is."""
        if not self._session.poll(now_s):
            return self._session.text
        if self._buffered_connection != self._session.connections:
            if not self._session.due(_BUFFER, now_s, _BUFFER_RETRY_S):
                return self._session.refusal(_BUFFER, self._waiting)
            if self._left_moving():
                self.stop()
                self._waiting = _LEFT_MOVING
                return self._waiting
            self._waiting = self._session.text
            problem = self._ask(_BUFFER, self._create_buffer, _advanced_text)
            if problem is not None:
                return problem.text
            self._buffered_connection = self._session.connections
        return ""

    def read(self) -> ArmState | Blind:
        """The status at this moment."""
        problem = self._ask(_STATUS, self._read_status, _base_text)
        if problem is not None:
            return Blind(problem, gone=self._session.engine is None)
        return arm_state(self._snapshot, self._n_joints)

    def close(self) -> None:
        self._session.close()

    # --- motion ------------------------------------------------------------------------------------------------------

    def start(self, spline: ClampedSpline) -> Fault | None:
        if self._buffered_connection != self._session.connections:
            text = self._session.refusal(_BUFFER, "the spline buffer does not exist yet")
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
        """Sets an output bit and reads it back. Without the bus it has no effect."""
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

    def _left_moving(self) -> bool:
        """True if the engine still executes a trajectory of a server that crashed: its goal has no client any more."""
        state = self.read()
        if isinstance(state, Blind) or not state.communicating:
            return False
        states = self._snapshot.op_state[: self._n_joints]
        return bool(np.isin(states, (OperationState.Intpl, OperationState.Stop)).any())

    def _axes(self) -> AxisSelection:
        return AxisSelection.of(*range(self._n_joints))

    def _read_status(self, engine: MotionEngine) -> int:
        code, snapshot = engine.read_status()
        if not code and snapshot.n_axes < self._n_joints:
            return ErrorCode.AxisOutOfRange
        self._snapshot = snapshot
        return code

    def _create_buffer(self, engine: MotionEngine) -> int:
        """Creates the buffer, or uses a large enough one of an earlier server."""
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
        refusal = Fault(ErrorCode.IMLibIsNotRunning, f"{what}: {self._session.text}")

        def noted(engine: MotionEngine) -> int:
            nonlocal refusal
            code = request(engine)
            if code:
                refusal = Fault(int(code), f"{what}: {text(engine, code)} (error {int(code)})")
            return code

        return None if self._session.ask(what, noted) else refusal


def _base_text(engine: MotionEngine, code: int) -> str:
    return engine.api.ErrorToString(code)


def _motion_text(engine: MotionEngine, code: int) -> str:
    return engine.core_motion.ErrorToString(code)


def _advanced_text(engine: MotionEngine, code: int) -> str:
    return engine.advanced_motion.ErrorToString(code)


def _io_text(engine: MotionEngine, code: int) -> str:
    return engine.io.ErrorToString(code)
