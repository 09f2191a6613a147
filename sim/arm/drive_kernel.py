"""The joint drives of the arm, one cycle in one compiled function.

Encoder, observer, state machine, torque limit and loops are those of ``sim.plant.drive_loops``, with its rows.
Differences of an arm: a joint carries weight, so its brake opens only after the motor has taken over the load, stays
open while the servo is on, and closes before the power is cut; and the drive is synchronous to the bus (distributed
clocks): the position of a telegram is the target one cycle later.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.compiled import compiled
from robot_stack.wmx.bus import DriveCommands
from sim.plant.drive_loops import (
    ALARM,
    ON,
    P_BRAKE_HOLD_DELAY,
    P_BRAKE_RELEASE_DELAY,
    P_BRAKE_TORQUE,
    P_DYNAMIC_BRAKE,
    P_FEEDFORWARD,
    P_FRICTION,
    P_LAG_FACTOR,
    P_MAX_SPEED,
    P_MAX_TORQUE,
    P_POSITION_GAIN,
    S_ANGLE,
    S_BRAKE_CLOSED,
    S_BRAKE_TIMER,
    S_INTEGRAL,
    S_SILENCE,
    S_SPEED_COMMAND,
    S_STATE,
    S_TORQUE,
    S_TORQUE_COMMAND,
    STOPPING,
    Matrix,
    _control,
    _observe,
    _powered,
    _speed_command,
    _supervise,
)
from sim.plant.drive_loops import P_RAD_PER_COUNT as P_RAD_PER_COUNT

_BLOCKED_TORQUE = 10.0  # of the motor's limit: what a jammed joint holds
MODE_POSITION = 0


@compiled
def _brake(i: int, dt: float, p: Matrix, s: Matrix) -> bool:
    """Moves the brake. True while it holds a powered joint."""
    if _powered(i, s):
        if s[S_BRAKE_CLOSED, i] > 0.0:
            s[S_BRAKE_TIMER, i] += dt
            if s[S_BRAKE_TIMER, i] > p[P_BRAKE_RELEASE_DELAY, i]:
                s[S_BRAKE_CLOSED, i], s[S_BRAKE_TIMER, i] = 0.0, 0.0
        return bool(s[S_BRAKE_CLOSED, i] > 0.0)
    s[S_BRAKE_TIMER, i] += dt
    # In an orderly switch-off a drive keeps its power until the brake has closed; an alarm cuts the power first.
    if s[S_STATE, i] != ALARM or s[S_BRAKE_TIMER, i] > p[P_BRAKE_HOLD_DELAY, i]:
        s[S_BRAKE_CLOSED, i] = 1.0
    return False


@compiled
def _torque(
    i: int, dt: float, mode: int, target: float, speed: float, load: float, preset: float, p: Matrix, s: Matrix
) -> float:
    """Torque set point of the motor."""
    if _brake(i, dt, p, s):
        s[S_INTEGRAL, i] = preset * load
        s[S_SPEED_COMMAND, i] = 0.0
        return float(s[S_INTEGRAL, i])
    follows = s[S_STATE, i] == ON and mode == MODE_POSITION
    if follows:
        limit = p[P_MAX_SPEED, i]
        behind = target - s[S_ANGLE, i]  # both of the cycle's end: the observer is one cycle ahead of its count
        requested = min(limit, max(-limit, speed + p[P_POSITION_GAIN, i] * behind))
        reference = speed
    else:
        requested = _speed_command(i, dt, mode, target, speed, p, s)
        reference = requested
    feedforward = p[P_FEEDFORWARD, i] * (reference - s[S_SPEED_COMMAND, i]) / dt
    s[S_SPEED_COMMAND, i] = reference
    return float(_control(i, dt, requested, feedforward, p, s))


@compiled
def observe_joints(dt: float, qpos: Matrix, qpos_index: NDArray[np.int64], p: Matrix, s: Matrix) -> None:
    """Reads the encoders after a step of the physics, for the next telegram."""
    for i in range(qpos_index.shape[0]):
        _observe(i, qpos[qpos_index[i]], dt, p, s)


@compiled
def step_joints(
    dt: float,
    qvel: Matrix,
    load: Matrix,
    qvel_index: NDArray[np.int64],
    commands: DriveCommands,
    blocked: NDArray[np.bool_],
    preset: float,
    p: Matrix,
    s: Matrix,
    torque_out: Matrix,
    friction_out: Matrix,
) -> None:
    """One cycle of all drives.

    qvel, load (degrees of freedom,): joint speeds, and the torques that weight and motion put on the joints. preset:
    share of the load that a motor takes over before its brake opens. torque_out (axes,) takes the motors' torques,
    friction_out (degrees of freedom,) the dry friction of each joint.
    """
    mode = commands.mode
    for i in range(qvel_index.shape[0]):
        joint = qvel_index[i]
        target = (commands.position_counts[i] + 0.5) * p[P_RAD_PER_COUNT, i]
        speed = commands.velocity_counts_per_s[i] * p[P_RAD_PER_COUNT, i]
        _supervise(i, dt, commands.servo_on[i], mode[i], target, speed, commands.clear_alarm[i], p, s)
        torque = _torque(i, dt, mode[i], target, speed, load[joint], preset, p, s)
        if s[S_STATE, i] == ON or s[S_STATE, i] == STOPPING:
            s[S_TORQUE_COMMAND, i] = torque
            s[S_TORQUE, i] += p[P_LAG_FACTOR, i] * (torque - s[S_TORQUE, i])
        else:
            s[S_TORQUE_COMMAND, i] = 0.0
            windings = -p[P_DYNAMIC_BRAKE, i] * qvel[joint]
            s[S_TORQUE, i] = min(p[P_MAX_TORQUE, i], max(-p[P_MAX_TORQUE, i], windings))
        torque_out[i] = s[S_TORQUE, i]
        friction = p[P_FRICTION, i] + s[S_BRAKE_CLOSED, i] * p[P_BRAKE_TORQUE, i]
        if blocked[i]:
            friction += _BLOCKED_TORQUE * p[P_MAX_TORQUE, i]
        friction_out[joint] = friction
        s[S_SILENCE, i] += dt
