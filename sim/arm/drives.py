"""The joint drives and the gripper's output on the engine's fieldbus."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from sim.arm.drive_kernel import observe_joints, step_joints
from sim.arm.params import N_JOINTS, ArmParams
from sim.plant import drive_loops as loops
from sim.plant.drive_loops import JointIndex
from sim.plant.drives import Drives

_TURN_RAD = 2.0 * math.pi


class ArmDrives(Drives):
    """Six drives on a synchronous bus: commands of ``exchange`` act in the following cycle, and it returns the
    measurements of the end of the last one.

    ``exchange`` is the engine's side (a ServoBus), ``step`` and ``observe`` the world's. The engine sees positions in
    encoder counts, torque in percent of the rated torque.
    """

    n_axes = N_JOINTS

    def __init__(self, params: ArmParams, dt_s: float) -> None:
        self._dt_s = dt_s
        self._preset = params.drives.brake_preset
        super().__init__(drive_parameters(params, dt_s))
        self._commands = DriveCommands.zeros(N_JOINTS, 0)
        self._blocked = np.zeros(N_JOINTS, np.bool_)
        self._output = (params.gripper.output_byte, params.gripper.output_bit)
        self._watchdog_s = params.drives.bus_watchdog_s
        self.gripper_closes = False

    # --- the engine's side ----------------------------------------------------------------------------------------

    def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
        """Takes ``out`` and fills ``inp``; False while the bus is cut."""
        if not self._bus_up:
            return False
        own = self._commands
        own.servo_on[:], own.mode[:], own.clear_alarm[:] = out.servo_on, out.mode, out.clear_alarm
        own.position_counts[:] = out.position_counts
        own.velocity_counts_per_s[:] = out.velocity_counts_per_s
        byte, bit = self._output
        self.gripper_closes = byte < out.outputs.size and bool(int(out.outputs[byte]) >> bit & 1)
        self._state[loops.S_SILENCE] = 0.0
        self._fill(inp)
        return True

    def _fill(self, inp: DriveFeedback) -> None:
        s, p = self._state, self._parameters
        inp.position_counts[:] = s[loops.S_COUNT]
        np.divide(s[loops.S_SPEED], p[loops.P_RAD_PER_COUNT], out=inp.velocity_counts_per_s)
        direction = np.sign(p[loops.P_RAD_PER_COUNT])
        np.multiply(s[loops.S_TORQUE], 100.0 * direction / p[loops.P_RATED_TORQUE], out=inp.torque_percent)
        np.logical_and(s[loops.S_STATE] == loops.ON, s[loops.S_BRAKE_CLOSED] == 0.0, out=inp.servo_on)
        inp.alarm_code[:] = s[loops.S_ALARM_CODE]

    # --- the world's side -----------------------------------------------------------------------------------------

    def observe(self, qpos: NDArray[np.float64], index: JointIndex) -> None:
        """Reads the encoders at the end of a cycle."""
        observe_joints(self._dt_s, qpos, index.qpos, self._parameters, self._state)

    def begin(self, qpos: NDArray[np.float64], index: JointIndex) -> None:
        """Initialises the observers by the absolute encoders at power-on."""
        self._state[loops.S_ANGLE] = qpos[index.qpos]
        self.observe(qpos, index)
        self._state[loops.S_ANGLE], self._state[loops.S_SPEED] = qpos[index.qpos], 0.0

    def step(
        self,
        qvel: NDArray[np.float64],
        load_nm: NDArray[np.float64],
        index: JointIndex,
        torque_out: NDArray[np.float64],
        friction_out: NDArray[np.float64],
    ) -> None:
        """One cycle: motor torques into ``torque_out`` (6,), dry friction into ``friction_out`` (dofs,)."""
        step_joints(
            self._dt_s,
            qvel,
            load_nm,
            index.qvel,
            self._commands,
            self._blocked,
            self._preset,
            self._parameters,
            self._state,
            torque_out,
            friction_out,
        )
        if self._state[loops.S_SILENCE, 0] > self._watchdog_s:
            self.gripper_closes = False  # outputs of an I/O terminal without communication go off

    # --- faults ---------------------------------------------------------------------------------------------------

    def set_blocked(self, axis: int, blocked: bool) -> None:
        """Blocks a joint, or releases it; a blocked joint does not turn under any motor torque."""
        self._blocked[axis] = blocked


def drive_parameters(params: ArmParams, dt_s: float) -> NDArray[np.float64]:
    """The parameter matrix of ``sim.plant.drive_loops``; a reversed encoder has negative rad per count."""
    matrix = np.zeros((loops.N_PARAMETERS, N_JOINTS))
    for axis, joint in enumerate(params.joints):
        for row, value in (_common(params, dt_s) | _of_joint(params, axis)).items():
            matrix[row, axis] = value
        matrix[loops.P_RAD_PER_COUNT, axis] *= joint.direction
    return matrix


def _common(params: ArmParams, dt_s: float) -> dict[int, float]:
    drives = params.drives
    return {
        loops.P_HAS_BRAKE: 1.0,
        loops.P_OBSERVER: drives.observer_bandwidth_radps,
        loops.P_LAG_FACTOR: 1.0 - math.exp(-dt_s / drives.torque_lag_s),
        loops.P_DYNAMIC_BRAKE: drives.dynamic_brake_nms,
        loops.P_OVERLOAD_TIME: drives.overload_time_s,
        loops.P_FOLLOWING_ERROR: drives.following_error_rad,
        loops.P_SERVO_ON_DELAY: drives.servo_on_delay_s,
        loops.P_CLEAR_DELAY: drives.alarm_clear_delay_s,
        loops.P_BRAKE_RELEASE_DELAY: drives.brake_release_delay_s,
        loops.P_BRAKE_HOLD_DELAY: drives.brake_engage_delay_s,
        loops.P_BRAKE_CLOSE_SPEED: drives.standstill_radps,
        loops.P_BRAKE_CLOSE_TIMEOUT: drives.stop_timeout_s,
        loops.P_WATCHDOG: drives.bus_watchdog_s,
    }


def _of_joint(params: ArmParams, axis: int) -> dict[int, float]:
    kind, drives = params.kind(axis), params.drives
    return {
        loops.P_RAD_PER_COUNT: _TURN_RAD / kind.encoder_counts_per_rev,
        loops.P_POSITION_GAIN: kind.position_gain_per_s,
        loops.P_SPEED_GAIN: kind.speed_gain_nms,
        loops.P_SPEED_INTEGRAL: kind.speed_integral_per_s,
        loops.P_FEEDFORWARD: kind.acceleration_feedforward_kgm2,
        loops.P_MAX_TORQUE: kind.max_torque_nm,
        loops.P_RATED_TORQUE: kind.rated_torque_nm,
        loops.P_CORNER_SPEED: kind.constant_torque_speed_radps,
        loops.P_MAX_SPEED: kind.no_load_speed_radps,
        loops.P_OVERSPEED: kind.max_speed_radps * drives.overspeed_factor,
        loops.P_OVERLOAD_TORQUE: kind.max_torque_nm * drives.overload_fraction,
        loops.P_FRICTION: kind.friction_nm,
        loops.P_BRAKE_TORQUE: kind.brake_torque_nm,
        loops.P_STOP_DECELERATION: kind.stop_deceleration_radps2,
    }
