"""Motion of a homing axis, and its progress."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.wmx.api.enums import DetailOperationState, OperationState
from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.api.parameters import Config_HomeParam
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.simulated import rows
from robot_stack.wmx.simulated.homing_types import Limited, Search
from robot_stack.wmx.simulated.kernel import begin_stop
from robot_stack.wmx.simulated.profile import plan_position, plan_velocity
from robot_stack.wmx.simulated.state import EngineArrays
from robot_stack.wmx.simulated.switch_kernel import IGNORE_NEGATIVE_END, IGNORE_POSITIVE_END


@dataclass(slots=True)
class Run:
    """One homing axis.

    ``ahead``: the remaining searches, the present one first; empty: shifting. ``found``: end of the last search,
    ``reached``: the farthest place in the homing direction where the axis has stood.
    """

    param: Config_HomeParam
    ahead: list[Search]
    direction: float
    begun_at: float = 0.0
    found: float = 0.0
    reached: float = -math.inf
    was_on: bool = False
    stopping: bool = False
    beyond: bool = False
    turned: bool = False

    @property
    def way(self) -> float:
        """Direction of the present search."""
        return -self.direction if self.ahead[0].reverse else self.direction

    @property
    def speeds(self) -> tuple[float, float, float]:
        """Velocity, acceleration and deceleration of the present search."""
        p = self.param
        return p.homingVelocityFast, p.homingVelocityFastAcc, p.homingVelocityFastDec

    def too_far(self, position: float) -> bool:
        """True if the present search exceeds the distance of its parameter; 0 is no limit."""
        limits = {
            Limited.HOME_ON_AT_START: self.param.maxHSOnAtStartReverseDistance,
            Limited.AFTER_LIMIT: self.param.maxLSReverseDistance,
        }
        limit = limits.get(self.ahead[0].limited, 0.0)
        return limit > 0.0 and abs(position - self.begun_at) > limit


class HomingMotion:
    """Plans of axes in the state Home. The kernel carries them out and leaves an axis idle when one has ended."""

    def __init__(self, arrays: EngineArrays) -> None:
        self._a = arrays

    def claim(self, axis: int, device: int, slow_dec: float) -> None:
        """Takes an idle axis for ``device``; from now on the homing handles the limits itself."""
        a = self._a
        a.params[rows.PROFILE_DEC, axis] = slow_dec
        a.params[rows.PROFILE_DEC_TIME, axis] = 0.0
        a.work[rows.RUN_CYCLES, axis] = 0
        a.work[rows.SERVO_OFF_AT_REST, axis] = 0
        a.work[rows.LS_IGNORED, axis] = IGNORE_POSITIVE_END | IGNORE_NEGATIVE_END
        for row in (Flag.MOTION_COMPLETE, Flag.IN_POS, Flag.POS_SET, Flag.END_REASON):
            a.flags[row, axis] = 0
        a.flags[Flag.OWNER, axis] = device

    def release(self, axis: int) -> None:
        """Restores the normal action of limits."""
        self._a.work[rows.LS_IGNORED, axis] = 0

    def run(self, axis: int, velocity: float, acc: float, dec: float) -> None:
        """Moves endlessly at a signed velocity."""
        position, present = self._present(axis)
        n = plan_velocity(self._a.plan[axis], position, present, velocity, acc, dec)
        self._begun(axis, n)

    def go(self, axis: int, target: float, speed: float, acc: float, dec: float) -> None:
        """Moves to a position."""
        position, present = self._present(axis)
        overtravel = int(self._a.work[rows.OVERTRAVEL, axis])
        n = plan_position(self._a.plan[axis], position, present, target, speed, acc, dec, overtravel)
        self._a.reals[Real.PROFILE_TARGET_POS, axis] = target
        self._begun(axis, n)

    def pause(self, axis: int, dec: float) -> None:
        """Stops as a step of the homing."""
        self.stop(axis, dec)
        self._at_home_work(axis)

    def stop(self, axis: int, dec: float) -> None:
        """Stops to end the homing."""
        a = self._a
        if a.flags[Flag.OP_STATE, axis] != OperationState.Stop:
            detail, reason = int(DetailOperationState.Stop), int(ErrorCode.PyNone)
            begin_stop(a.reals, a.flags, a.work, a.plan, axis, float(dec), detail, reason)

    def stopped(self, axis: int) -> bool:
        """True if a stop has begun that is no step of the homing."""
        return bool(self._a.work[rows.STOP_BEGUN, axis])

    def _present(self, axis: int) -> tuple[float, float]:
        reals = self._a.reals
        return float(reals[Real.POS_CMD, axis]), float(reals[Real.VELOCITY_CMD, axis])

    def _begun(self, axis: int, segments: int) -> None:
        self._a.work[rows.SEGMENTS, axis] = segments
        self._a.work[rows.TICK, axis] = 0
        self._a.flags[Flag.CMD_DISTRIBUTION_END, axis] = 0
        self._at_home_work(axis)

    def _at_home_work(self, axis: int) -> None:
        self._a.work[rows.STOP_BEGUN, axis] = 0
        self._a.flags[Flag.OP_STATE, axis] = OperationState.Home
        self._a.flags[Flag.DETAIL_OP_STATE, axis] = DetailOperationState.Home


def rename(a: EngineArrays, axis: int, row: Real, position: float) -> None:
    """Shifts the user positions of an axis so that ``row`` reads ``position``; encoder counts stay."""
    reals = a.reals
    shift = position - reals[row, axis]
    reals[Real.HOME_OFFSET, axis] -= shift
    for shifted in (Real.POS_CMD, Real.ACTUAL_POS, Real.PROFILE_TARGET_POS):
        reals[shifted, axis] += shift
    reals[row, axis] = position
