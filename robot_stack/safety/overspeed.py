"""Overspeed: compares the speed measured by the wheels with the permitted one (fault OVERSPEED).

A falling limit cannot be reached at once. The permitted speed stays constant for a while, the reaction time of the
drive, and then falls no slower than a share of the deceleration that belongs to the limit: the emergency
deceleration for a hard stop, else that of an ordinary ride. A limit that rises is permitted at once.
"""

from __future__ import annotations

from robot_stack.contract.model import SafetyAction
from robot_stack.core.geometry import Twist2
from robot_stack.core.limits import SpeedLimit
from robot_stack.core.robot import Motion
from robot_stack.safety.inputs import CLEAR, Finding, Level
from robot_stack.safety.params import OverspeedParams
from robot_stack.safety.timing import Hold, age_s


class PermittedSpeed:
    """The permitted value of one speed (m/s or rad/s) while its limit changes."""

    def __init__(self, permitted: float) -> None:
        self.permitted = permitted
        self._before_s: float | None = None
        self._falling_for = Hold()

    def update(self, limit: float, notice_s: float, deceleration: float, now_s: float) -> float:
        """The permitted speed at ``now_s``; steady seconds."""
        elapsed_s, self._before_s = age_s(now_s, self._before_s), now_s
        falling_for_s = self._falling_for.update(limit < self.permitted, now_s)
        if falling_for_s is None:
            self.permitted = limit
        elif falling_for_s > notice_s:
            self.permitted = max(limit, self.permitted - deceleration * elapsed_s)
        return self.permitted


class OverspeedWatch:
    """Tracks the published limits and the measured twist."""

    def __init__(self, params: OverspeedParams, own: SpeedLimit, brake_mps2: float) -> None:
        """own: the robot's own limits, permitted before any other. brake_mps2: emergency deceleration."""
        self._params, self._brake_mps2 = params, brake_mps2
        self._linear, self._angular = PermittedSpeed(own.linear_mps), PermittedSpeed(own.angular_radps)
        self._too_fast_for = Hold()

    def limited(self, limit: SpeedLimit, hard: bool, motion: Motion, now_s: float) -> None:
        """The limit that is in force from now on.

        hard: a stop at the emergency deceleration. motion: accelerations and jerk otherwise.
        """
        p = self._params
        brake_mps2 = self._brake_mps2 if hard else motion.max_acceleration_mps2
        jerk_s = 0.0 if hard else motion.max_acceleration_mps2 / motion.max_jerk_mps3
        notice_s = p.notice_s + jerk_s
        self._linear.update(limit.linear_mps, notice_s, p.deceleration_share * brake_mps2, now_s)
        turning_radps2 = p.deceleration_share * motion.max_yaw_acceleration_radps2
        self._angular.update(limit.angular_radps, notice_s, turning_radps2, now_s)

    def judge(self, measured: Twist2, now_s: float) -> Finding:
        """Judges the measured twist, zero while unknown: then JOINT_STATES_TIMEOUT stops the robot instead."""
        p, speed_mps, turning_radps = self._params, measured.speed(), abs(measured.omega)
        linear_mps, angular_radps = self._linear.permitted, self._angular.permitted
        too_fast = speed_mps > linear_mps + p.margin_mps or turning_radps > angular_radps + p.margin_radps
        for_s = self._too_fast_for.update(too_fast, now_s)
        if for_s is None or not for_s > p.hold_s:
            return CLEAR
        detail = (
            f"{speed_mps:.2f} m/s, {turning_radps:.2f} rad/s where {linear_mps:.2f} m/s, "
            f"{angular_radps:.2f} rad/s are permitted"
        )
        return Finding(Level.PRESENT, SafetyAction.EMERGENCY_STOP, detail=detail)
