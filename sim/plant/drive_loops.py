"""The inner loops of all servo drives, one cycle in one compiled function.

A drive is modelled like a real one: encoder with counts, a speed observer on those counts, position P -> speed PI with
acceleration feed-forward -> torque limit (flat, then falling with speed) -> current loop lag, and a small state machine
for servo-on, alarms, the holding brake and the loss of the bus. The holding brake is a dry friction on the joint; with
the power stage off the shorted windings brake like a viscous one.

Arrays are (row, axis); rows by the ``P_*`` (parameters) and ``S_*`` (state) numbers below. Angles rad, speeds rad/s,
torques Nm, times s, all at the joint.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import JOINTS
from robot_stack.core.compiled import compiled
from robot_stack.wmx.bus import DriveCommands, DriveFeedback

Matrix = NDArray[np.float64]

# --- drive states -------------------------------------------------------------------------------------------------
OFF, STARTING, ON, STOPPING, ALARM = 0, 1, 2, 3, 4

# --- alarm codes, by the drive profile CiA 402 where it has one ---------------------------------------------------
ALARM_NONE = 0
ALARM_OVERLOAD = 0x3230
ALARM_INVALID_COMMAND = 0x6320
ALARM_OVERSPEED = 0x7310
ALARM_BUS = 0x7500
ALARM_FOLLOWING_ERROR = 0x8611

# --- parameter rows -----------------------------------------------------------------------------------------------
(
    P_HAS_BRAKE,
    P_RAD_PER_COUNT,
    P_ZERO_ERROR,
    P_POSITION_GAIN,
    P_SPEED_GAIN,
    P_SPEED_INTEGRAL,
    P_FEEDFORWARD,
    P_OBSERVER,
    P_MAX_TORQUE,
    P_CORNER_SPEED,
    P_MAX_SPEED,
    P_LAG_FACTOR,
    P_DYNAMIC_BRAKE,
    P_COGGING,
    P_COGGING_PER_REV,
    P_COGGING_PHASE,
    P_NOISE,
    P_FRICTION,
    P_BRAKE_TORQUE,
    P_STOP_DECELERATION,
    P_OVERSPEED,
    P_OVERLOAD_TORQUE,
    P_OVERLOAD_TIME,
    P_FOLLOWING_ERROR,
    P_SERVO_ON_DELAY,
    P_CLEAR_DELAY,
    P_BRAKE_RELEASE_DELAY,
    P_BRAKE_HOLD_DELAY,
    P_BRAKE_CLOSE_SPEED,
    P_BRAKE_CLOSE_TIMEOUT,
    P_WATCHDOG,
    P_RATED_TORQUE,
    N_PARAMETERS,
) = range(33)

# --- state rows ---------------------------------------------------------------------------------------------------
(
    S_STATE,
    S_TIMER,  # since the state was entered
    S_COUNT,
    S_ANGLE,  # observed
    S_SPEED,  # observed
    S_SPEED_COMMAND,  # of the last cycle, after limits
    S_INTEGRAL,
    S_TORQUE_COMMAND,
    S_TORQUE,  # of the motor, after the current loop
    S_ALARM_CODE,
    S_BRAKE_CLOSED,
    S_BRAKE_TIMER,
    S_OVERLOAD_TIMER,
    S_SILENCE,  # since the last telegram
    S_CLEAR_TIMER,
    S_INJECTED_ALARM,  # code of a fault that persists, 0 = none
    S_FROZEN,  # encoder
    N_STATES,
) = range(18)

MODE_POSITION = 0
# A commanded speed below this is a command to stand: less than one encoder count in ten cycles.
STANDSTILL_RADPS = 0.02


class JointIndex(NamedTuple):
    """Where joints are in MuJoCo's qpos and qvel."""

    qpos: NDArray[np.int64]
    qvel: NDArray[np.int64]

    @classmethod
    def of(cls, model: Any, names: Sequence[str] = JOINTS) -> JointIndex:
        return cls(
            np.array([model.joint(name).qposadr[0] for name in names], np.int64),
            np.array([model.joint(name).dofadr[0] for name in names], np.int64),
        )


@compiled
def _observe(i: int, angle: float, dt: float, p: Matrix, s: Matrix) -> None:
    """Counts from the true angle, then a critically damped second-order observer for angle and speed."""
    if s[S_FROZEN, i] == 0.0:
        s[S_COUNT, i] = math.floor((angle + p[P_ZERO_ERROR, i]) / p[P_RAD_PER_COUNT, i])
    error = (s[S_COUNT, i] + 0.5) * p[P_RAD_PER_COUNT, i] - s[S_ANGLE, i]
    bandwidth = p[P_OBSERVER, i]
    s[S_ANGLE, i] += dt * (s[S_SPEED, i] + 2.0 * bandwidth * error)
    s[S_SPEED, i] += dt * bandwidth * bandwidth * error


@compiled
def _enter(i: int, state: int, s: Matrix) -> None:
    s[S_STATE, i] = state
    s[S_TIMER, i] = 0.0
    s[S_BRAKE_TIMER, i] = 0.0
    s[S_OVERLOAD_TIMER, i] = 0.0


@compiled
def _raise_alarm(i: int, code: int, s: Matrix) -> None:
    s[S_ALARM_CODE, i] = code
    s[S_CLEAR_TIMER, i] = 0.0
    _enter(i, ALARM, s)


@compiled
def _powered(i: int, s: Matrix) -> bool:
    return bool(s[S_STATE, i] == ON or s[S_STATE, i] == STOPPING)


@compiled
def _supervise(
    i: int, dt: float, servo_on: bool, mode: int, target: float, speed: float, clear: bool, p: Matrix, s: Matrix
) -> None:
    """The drive's state machine: alarms first, then loss of the bus, then the engine's requests."""
    s[S_TIMER, i] += dt
    state = s[S_STATE, i]
    if s[S_INJECTED_ALARM, i] != 0.0 and s[S_ALARM_CODE, i] != s[S_INJECTED_ALARM, i]:
        _raise_alarm(i, int(s[S_INJECTED_ALARM, i]), s)
    elif state == ALARM:
        asked = clear or s[S_CLEAR_TIMER, i] > 0.0  # one request is enough, however short
        s[S_CLEAR_TIMER, i] = s[S_CLEAR_TIMER, i] + dt if asked and s[S_INJECTED_ALARM, i] == 0.0 else 0.0
        if s[S_CLEAR_TIMER, i] > p[P_CLEAR_DELAY, i]:
            s[S_ALARM_CODE, i] = ALARM_NONE
            _enter(i, OFF, s)
    elif not math.isfinite(speed):
        _raise_alarm(i, ALARM_INVALID_COMMAND, s)
    elif abs(s[S_SPEED, i]) > p[P_OVERSPEED, i]:
        _raise_alarm(i, ALARM_OVERSPEED, s)
    elif state == STOPPING:
        stopped = p[P_HAS_BRAKE, i] > 0.0 and abs(s[S_SPEED, i]) < p[P_BRAKE_CLOSE_SPEED, i]
        if stopped or s[S_TIMER, i] > p[P_BRAKE_CLOSE_TIMEOUT, i]:
            _raise_alarm(i, ALARM_BUS, s)
    elif state == ON:
        if s[S_SILENCE, i] > p[P_WATCHDOG, i]:
            # Reported at once and not only when stopped, like CiA 402's fault reaction: after a reconnection the drive
            # must not be taken for one that is merely off.
            s[S_ALARM_CODE, i] = ALARM_BUS
            _enter(i, STOPPING, s)
        elif not servo_on:
            _enter(i, OFF, s)
        elif s[S_OVERLOAD_TIMER, i] > p[P_OVERLOAD_TIME, i]:
            _raise_alarm(i, ALARM_OVERLOAD, s)
        elif mode == MODE_POSITION and abs(target - s[S_ANGLE, i]) > p[P_FOLLOWING_ERROR, i]:
            _raise_alarm(i, ALARM_FOLLOWING_ERROR, s)
    elif not servo_on or s[S_SILENCE, i] > p[P_WATCHDOG, i]:
        if state == STARTING:
            _enter(i, OFF, s)
    elif state == OFF:
        _enter(i, STARTING, s)
    elif s[S_TIMER, i] > p[P_SERVO_ON_DELAY, i]:
        _enter(i, ON, s)
        s[S_INTEGRAL, i] = 0.0
        s[S_SPEED_COMMAND, i] = s[S_SPEED, i]


@compiled
def _speed_command(i: int, dt: float, mode: int, target: float, speed: float, p: Matrix, s: Matrix) -> float:
    """Set point of the speed loop, within the drive's speed limit."""
    if s[S_STATE, i] == STOPPING:
        step = dt * p[P_STOP_DECELERATION, i]
        before = s[S_SPEED_COMMAND, i]
        return math.copysign(max(0.0, abs(before) - step), before)
    requested = speed
    if mode == MODE_POSITION:
        requested = speed + p[P_POSITION_GAIN, i] * (target - s[S_ANGLE, i])
    limit = p[P_MAX_SPEED, i]
    return float(min(limit, max(-limit, requested)))


@compiled
def _brake(i: int, dt: float, requested: float, p: Matrix, s: Matrix) -> bool:
    """Moves the holding brake. True while the shaft is not free, so that the motor must give no torque."""
    if p[P_HAS_BRAKE, i] == 0.0:
        return False
    if not _powered(i, s):
        slow = abs(s[S_SPEED, i]) < p[P_BRAKE_CLOSE_SPEED, i]
        if slow or s[S_TIMER, i] > p[P_BRAKE_CLOSE_TIMEOUT, i]:
            s[S_BRAKE_CLOSED, i] = 1.0
        return True
    standing = abs(requested) < STANDSTILL_RADPS
    if s[S_BRAKE_CLOSED, i] > 0.0:
        s[S_BRAKE_TIMER, i] = 0.0 if standing else s[S_BRAKE_TIMER, i] + dt
        if s[S_BRAKE_TIMER, i] > p[P_BRAKE_RELEASE_DELAY, i]:
            s[S_BRAKE_CLOSED, i], s[S_BRAKE_TIMER, i] = 0.0, 0.0
            s[S_SPEED_COMMAND, i] = 0.0
        return bool(s[S_BRAKE_CLOSED, i] > 0.0)
    at_rest = standing and abs(s[S_SPEED, i]) < p[P_BRAKE_CLOSE_SPEED, i]
    s[S_BRAKE_TIMER, i] = s[S_BRAKE_TIMER, i] + dt if at_rest else 0.0
    if s[S_BRAKE_TIMER, i] > p[P_BRAKE_HOLD_DELAY, i]:
        s[S_BRAKE_CLOSED, i], s[S_BRAKE_TIMER, i] = 1.0, 0.0
    return bool(s[S_BRAKE_CLOSED, i] > 0.0)


@compiled
def _torque_limit(i: int, torque: float, speed: float, p: Matrix) -> float:
    """The motor's limit: flat to the corner speed, then falling to zero at the speed limit; full when braking."""
    peak = float(p[P_MAX_TORQUE, i])
    if torque * speed <= 0.0 or abs(speed) <= p[P_CORNER_SPEED, i]:
        return peak
    left = (p[P_MAX_SPEED, i] - abs(speed)) / (p[P_MAX_SPEED, i] - p[P_CORNER_SPEED, i])
    return peak * float(max(0.0, left))


@compiled
def _control(i: int, dt: float, requested: float, feedforward: float, p: Matrix, s: Matrix) -> float:
    """Speed PI with feed-forward; the integral is frozen while the torque is at its limit."""
    error = requested - s[S_SPEED, i]
    wanted = p[P_SPEED_GAIN, i] * error + s[S_INTEGRAL, i] + feedforward
    limit = _torque_limit(i, wanted, s[S_SPEED, i], p)
    torque = min(limit, max(-limit, wanted))
    if torque == wanted or error * wanted < 0.0:
        s[S_INTEGRAL, i] += dt * p[P_SPEED_GAIN, i] * p[P_SPEED_INTEGRAL, i] * error
    loaded = abs(torque) >= p[P_OVERLOAD_TORQUE, i]
    s[S_OVERLOAD_TIMER, i] = s[S_OVERLOAD_TIMER, i] + dt if loaded else 0.0
    return float(torque)


@compiled
def step_drives(
    dt: float,
    qpos: Matrix,
    qvel: Matrix,
    index: JointIndex,
    commands: DriveCommands,
    noise: Matrix,
    p: Matrix,
    s: Matrix,
    torque_out: Matrix,
    friction_out: Matrix,
) -> None:
    """One cycle of all drives.

    qpos, qvel by index give the true joint angles and speeds; noise is (axes,) standard normal;
    torque_out (axes,) takes the joint torques, friction_out (degrees of freedom,) the dry friction of each joint.
    """
    mode = commands.mode
    for i in range(index.qpos.shape[0]):
        angle, true_speed = qpos[index.qpos[i]], qvel[index.qvel[i]]
        _observe(i, angle, dt, p, s)
        target = (commands.position_counts[i] + 0.5) * p[P_RAD_PER_COUNT, i]
        speed = commands.velocity_counts_per_s[i] * p[P_RAD_PER_COUNT, i]
        _supervise(i, dt, commands.servo_on[i], mode[i], target, speed, commands.clear_alarm[i], p, s)
        requested = 0.0
        if _powered(i, s):
            requested = _speed_command(i, dt, mode[i], target, speed, p, s)
        held = _brake(i, dt, requested, p, s)
        torque = 0.0
        if _powered(i, s) and not held:
            reference = requested
            if mode[i] == MODE_POSITION and s[S_STATE, i] == ON:
                reference = speed
            feedforward = p[P_FEEDFORWARD, i] * (reference - s[S_SPEED_COMMAND, i]) / dt
            torque = _control(i, dt, requested, feedforward, p, s)
            s[S_SPEED_COMMAND, i] = reference
        s[S_TORQUE_COMMAND, i] = torque
        if _powered(i, s):
            s[S_TORQUE, i] += p[P_LAG_FACTOR, i] * (torque - s[S_TORQUE, i])
            ripple = p[P_NOISE, i] * noise[i] if not held else 0.0
        else:
            windings = -p[P_DYNAMIC_BRAKE, i] * true_speed
            s[S_TORQUE, i] = min(p[P_MAX_TORQUE, i], max(-p[P_MAX_TORQUE, i], windings))
            ripple = 0.0
        cogging = p[P_COGGING, i] * math.sin(p[P_COGGING_PER_REV, i] * angle + p[P_COGGING_PHASE, i])
        torque_out[i] = s[S_TORQUE, i] + ripple + cogging
        closed = s[S_BRAKE_CLOSED, i] * p[P_BRAKE_TORQUE, i]
        friction_out[index.qvel[i]] = p[P_FRICTION, i] + closed
        s[S_SILENCE, i] += dt


@compiled
def fill_feedback(p: Matrix, s: Matrix, read: DriveFeedback) -> None:
    """The drives' answers to a telegram. Resets their silence."""
    for i in range(s.shape[1]):
        read.position_counts[i] = int(s[S_COUNT, i])
        read.velocity_counts_per_s[i] = s[S_SPEED, i] / p[P_RAD_PER_COUNT, i]
        read.torque_percent[i] = s[S_TORQUE, i] * (100.0 / p[P_RATED_TORQUE, i])
        read.servo_on[i] = s[S_STATE, i] == ON
        read.alarm_code[i] = int(s[S_ALARM_CODE, i])
        s[S_SILENCE, i] = 0.0
