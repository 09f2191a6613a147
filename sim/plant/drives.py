"""The servo drives of the eight axes and the digital I/O on the engine's fieldbus."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract.frames import JOINTS
from robot_stack.core.robot import Motor, Robot
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from sim.params import PositionLoop, SimParams, SpeedLoop
from sim.plant import drive_loops as loops
from sim.plant.drive_loops import JointIndex
from sim.plant.robot_model import Tolerances

N_AXES = len(JOINTS)
# Noise is drawn in blocks: one call of the generator each cycle would cost more than the drives themselves.
_NOISE_BLOCK = 512
_TURN_RAD = 2.0 * math.pi
EDGE_RELAY = "relay"  # of the safety edge, beside the names of its sides


class Drives:
    """The state of drives on a bus, and their faults. Arrays are by joint."""

    def __init__(self, parameters: NDArray[np.float64]) -> None:
        self._parameters = parameters
        self._state = np.zeros((loops.N_STATES, parameters.shape[1]))
        self._state[loops.S_BRAKE_CLOSED] = parameters[loops.P_HAS_BRAKE]
        self._bus_up = True

    def set_bus(self, up: bool) -> None:
        """Connects or cuts the bus."""
        self._bus_up = up

    def set_alarm(self, axis: int, code: int) -> None:
        """A fault inside the drive that lasts until it is set to 0; the alarm then waits to be cleared."""
        self._state[loops.S_INJECTED_ALARM, axis] = code

    def set_encoder_frozen(self, axis: int, frozen: bool) -> None:
        """A frozen encoder repeats its last count."""
        self._state[loops.S_FROZEN, axis] = frozen

    @property
    def alarm_codes(self) -> NDArray[np.float64]:
        """Alarm codes, 0 = none."""
        return np.array(self._state[loops.S_ALARM_CODE])

    @property
    def brakes_closed(self) -> NDArray[np.bool_]:
        """True for closed holding brakes; the robot's steering axes have none."""
        return np.asarray(self._state[loops.S_BRAKE_CLOSED] > 0.0)

    @property
    def motor_torques_nm(self) -> NDArray[np.float64]:
        """Torque of each motor at its joint, without cogging."""
        return np.array(self._state[loops.S_TORQUE])


class ServoDrives(Drives):
    """Eight drives on a bus with one cycle of latency each way.

    ``exchange`` is the engine's side (a ServoBus), ``step`` the world's. The engine sees positions in encoder counts,
    speeds in counts/s, torque in percent of the motor's rated torque. The motors are wired to the engine's axes as
    ``robot.axes`` says; everything but ``exchange`` counts them by joint. Axes between them have no drive.
    """

    def __init__(
        self, robot: Robot, params: SimParams, tolerances: Tolerances, dt_s: float, random: np.random.Generator
    ) -> None:
        self._dt_s = dt_s
        self._wiring = Wiring.of(robot)
        self.n_axes = self._wiring.n_axes
        self._by_joint = DriveFeedback.zeros(N_AXES, 0)
        self._random = random
        self._noise = np.zeros((0, N_AXES))
        self._noise_row = 0
        super().__init__(drive_parameters(robot, params, tolerances, dt_s, random))
        # A drive knows its angle at power-on: its observer must not begin with a jump.
        self._state[loops.S_ANGLE] = [robot.axes[joint].zero_rad for joint in JOINTS]
        self._received = DriveCommands.zeros(N_AXES, 0)
        self._active = DriveCommands.zeros(N_AXES, 0)
        self._fresh = False
        self._estop = (robot.estop_input_byte, robot.estop_input_bit)
        self._latch = robot.latch
        self._inputs: dict[tuple[int, int], bool] = {self._estop: True}
        self._edge = robot.safety_edge
        self._edge_deformed: set[str] = set()
        self._edge_pressed: set[str] = set()
        self._edge_cut: set[str] = set()
        self._set_edge_inputs()
        self._silence_limit_s = params.drives.bus_watchdog_s
        self.outputs: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self._fill(DriveFeedback.zeros(self.n_axes, 0))  # compiled now, not with the bus's first telegram

    # --- the engine's side ----------------------------------------------------------------------------------------

    def exchange(self, out: DriveCommands, inp: DriveFeedback) -> bool:
        """Receives ``out``, which acts in the next cycle, and fills ``inp`` with the measurements of the last one."""
        if not self._bus_up:
            return False
        if self._wiring.straight:
            _copy(out, self._received)
        else:
            self._wiring.to_joints(out, self._received)
        self._fresh = True
        if self.outputs.size != out.outputs.size:
            self.outputs = np.zeros_like(out.outputs)
        self.outputs[:] = out.outputs
        self._fill(inp)
        return True

    def _fill(self, inp: DriveFeedback) -> None:
        read = inp if self._wiring.straight else self._by_joint
        loops.fill_feedback(self._parameters, self._state, read)
        if not self._wiring.straight:
            self._wiring.to_axes(read, inp)
        for (byte, bit), value in self._inputs.items():
            if byte < inp.inputs.size:
                others = int(inp.inputs[byte]) & ~(1 << bit)
                inp.inputs[byte] = others | value << bit

    # --- the world's side -----------------------------------------------------------------------------------------

    def step(
        self,
        qpos: NDArray[np.float64],
        qvel: NDArray[np.float64],
        index: JointIndex,
        torque_out: NDArray[np.float64],
        friction_out: NDArray[np.float64],
    ) -> None:
        """One cycle: joint torques into ``torque_out`` (8,), dry friction into ``friction_out`` (dofs,)."""
        loops.step_drives(
            self._dt_s,
            qpos,
            qvel,
            index,
            self._active,
            self._next_noise(),
            self._parameters,
            self._state,
            torque_out,
            friction_out,
        )
        if self._fresh:  # what was received acts from the next cycle on; every telegram fills all of the other one
            self._active, self._received = self._received, self._active
            self._fresh = False

    def _next_noise(self) -> NDArray[np.float64]:
        if self._noise_row >= len(self._noise):
            self._noise = self._random.standard_normal((_NOISE_BLOCK, N_AXES))
            self._noise_row = 0
        row: NDArray[np.float64] = self._noise[self._noise_row]
        self._noise_row += 1
        return row

    # --- faults and inputs ----------------------------------------------------------------------------------------

    def set_estop_pressed(self, pressed: bool) -> None:
        """The button is normally closed: its input bit is 1 while released."""
        self._inputs[self._estop] = not pressed

    @property
    def estop_pressed(self) -> bool:
        return not self._inputs[self._estop]

    def set_edge_deformed(self, side: str, deformed: bool) -> None:
        """A strip of the safety edge is deformed as far as its switch, or no longer."""
        if deformed != (side in self._edge_deformed):
            _set(self._edge_deformed, side, deformed)
            self._set_edge_inputs()

    def set_edge_pressed(self, side: str, pressed: bool) -> None:
        """Opens a side's switch and with it the relay, without a contact. Without an edge it has no effect."""
        _set(self._edge_pressed, side, pressed)
        self._set_edge_inputs()

    def set_edge_wire_cut(self, name: str, cut: bool) -> None:
        """Cuts the wire of a side's input or of the relay's (``EDGE_RELAY``); the other inputs keep their values."""
        _set(self._edge_cut, name, cut)
        self._set_edge_inputs()

    @property
    def edge_pressed(self) -> bool:
        """True if an input of the safety edge reads as pressed: also by a cut wire."""
        edge = self._edge
        if edge is None:
            return False
        bits = (*edge.side_bits.values(), edge.relay_input_bit)
        return not all(self._inputs[edge.byte, bit] for bit in bits)

    def _set_edge_inputs(self) -> None:
        """Normally closed: 1 = free. The relay has all sides in series."""
        edge = self._edge
        if edge is None:
            return
        open_sides = self._edge_deformed | self._edge_pressed
        for side, bit in edge.side_bits.items():
            self._inputs[edge.byte, bit] = side not in open_sides and side not in self._edge_cut
        self._inputs[edge.byte, edge.relay_input_bit] = not open_sides and EDGE_RELAY not in self._edge_cut

    def set_latch_inputs(self, closed: bool, open_: bool) -> None:
        """Sets the inputs of the latch's two switches."""
        self._inputs[self._latch.byte, self._latch.closed_input_bit] = closed
        self._inputs[self._latch.byte, self._latch.open_input_bit] = open_

    @property
    def latch_outputs(self) -> tuple[bool, bool]:
        """Close, open: as the engine last set them; both off on a silent bus, as an I/O terminal does by itself."""
        byte = self._latch.byte
        if byte >= self.outputs.size or self._state[loops.S_SILENCE, 0] > self._silence_limit_s:
            return False, False
        value = int(self.outputs[byte])
        return bool(value >> self._latch.close_output_bit & 1), bool(value >> self._latch.open_output_bit & 1)

    # --- what the world may know ----------------------------------------------------------------------------------

    @property
    def states(self) -> NDArray[np.float64]:
        """(8,) drive states, see drive_loops."""
        return np.array(self._state[loops.S_STATE])

    @property
    def powered(self) -> NDArray[np.bool_]:
        """(8,) power stage on."""
        state = self._state[loops.S_STATE]
        return np.asarray((state == loops.ON) | (state == loops.STOPPING))


@dataclass(frozen=True, slots=True)
class Wiring:
    """Which axis of the engine each joint's drive is, and in which direction its motor turns.

    axes: (8,) by joint. signs: (8,) 1 or -1. straight: joint i is axis i, and turns as the engine counts.
    """

    axes: NDArray[np.int64]
    signs: NDArray[np.int64]
    straight: bool

    @classmethod
    def of(cls, robot: Robot) -> Wiring:
        signs = [robot.axes[joint].polarity for joint in JOINTS]
        straight = robot.joint_axes == tuple(range(N_AXES)) and min(signs) > 0
        return cls(np.array(robot.joint_axes, np.int64), np.array(signs, np.int64), straight)

    @property
    def n_axes(self) -> int:
        return int(self.axes.max()) + 1

    def to_joints(self, out: DriveCommands, received: DriveCommands) -> None:
        """The engine's telegram, by joint and in the joints' direction."""
        axes, signs = self.axes, self.signs
        received.servo_on[:] = out.servo_on[axes]
        received.mode[:] = out.mode[axes]
        received.position_counts[:] = signs * out.position_counts[axes]
        received.velocity_counts_per_s[:] = signs * out.velocity_counts_per_s[axes]
        received.clear_alarm[:] = out.clear_alarm[axes]

    def to_axes(self, by_joint: DriveFeedback, inp: DriveFeedback) -> None:
        """The drives' answers by axis of the engine."""
        axes, signs = self.axes, self.signs
        inp.position_counts[axes] = signs * by_joint.position_counts
        inp.velocity_counts_per_s[axes] = signs * by_joint.velocity_counts_per_s
        inp.torque_percent[axes] = signs * by_joint.torque_percent
        inp.servo_on[axes] = by_joint.servo_on
        inp.alarm_code[axes] = by_joint.alarm_code


def drive_parameters(
    robot: Robot, params: SimParams, tolerances: Tolerances, dt_s: float, random: np.random.Generator
) -> NDArray[np.float64]:
    """The parameter matrix of ``drive_loops`` for the eight axes; cogging phases are drawn from ``random``."""
    matrix = np.zeros((loops.N_PARAMETERS, N_AXES))
    phases = random.uniform(0.0, _TURN_RAD, N_AXES)
    for axis in range(N_AXES):  # by joint
        module, is_steering = divmod(axis, 2)
        rows = _common(params)
        rows |= _steering(robot, params) if is_steering else _drive(robot, params)
        zero_rad = robot.axes[JOINTS[axis]].zero_rad  # what the robot's encoder reads at the joint's zero
        rows[loops.P_ZERO_ERROR] = zero_rad + (tolerances.steering_zeros_rad[module] if is_steering else 0.0)
        rows[loops.P_COGGING_PHASE] = float(phases[axis])
        lag_s = robot.steer.torque_lag_s if is_steering else robot.drive.torque_lag_s
        rows[loops.P_LAG_FACTOR] = 1.0 - math.exp(-dt_s / lag_s)
        for row, value in rows.items():
            matrix[row, axis] = value
    return matrix


def _common(params: SimParams) -> dict[int, float]:
    drives = params.drives
    return {
        loops.P_DYNAMIC_BRAKE: drives.dynamic_brake_nms,
        loops.P_OVERLOAD_TIME: drives.overload_time_s,
        loops.P_FOLLOWING_ERROR: drives.position_error_rad,
        loops.P_SERVO_ON_DELAY: drives.servo_on_delay_s,
        loops.P_CLEAR_DELAY: drives.alarm_clear_delay_s,
        loops.P_BRAKE_RELEASE_DELAY: drives.brake_release_delay_s,
        loops.P_BRAKE_HOLD_DELAY: drives.brake_hold_delay_s,
        loops.P_BRAKE_CLOSE_SPEED: drives.brake_close_speed_radps,
        loops.P_BRAKE_CLOSE_TIMEOUT: drives.brake_close_timeout_s,
        loops.P_WATCHDOG: drives.bus_watchdog_s,
    }


def _speed_loop(loop: SpeedLoop, motor: Motor, max_speed_radps: float, params: SimParams) -> dict[int, float]:
    max_torque_nm = motor.max_torque_nm
    return {
        loops.P_SPEED_GAIN: loop.speed_gain_nms,
        loops.P_SPEED_INTEGRAL: loop.speed_integral_per_s,
        loops.P_FEEDFORWARD: loop.acceleration_feedforward_kgm2,
        loops.P_OBSERVER: loop.observer_bandwidth_radps,
        loops.P_MAX_TORQUE: max_torque_nm,
        loops.P_RATED_TORQUE: motor.rated_torque_nm,
        loops.P_CORNER_SPEED: loop.constant_torque_speed_radps,
        loops.P_MAX_SPEED: max_speed_radps,
        loops.P_OVERSPEED: max_speed_radps * params.drives.overspeed_factor,
        loops.P_OVERLOAD_TORQUE: max_torque_nm * params.drives.overload_fraction,
    }


def _drive(robot: Robot, params: SimParams) -> dict[int, float]:
    drive, settings = robot.drive, params.drives
    rows = _speed_loop(settings.drive, drive, drive.max_speed_radps, params)
    return rows | {
        loops.P_HAS_BRAKE: 1.0,
        loops.P_RAD_PER_COUNT: _TURN_RAD / drive.counts_per_turn,
        loops.P_BRAKE_TORQUE: drive.brake_torque_nm,
        loops.P_FRICTION: params.wheel.rolling_friction_nm,
        loops.P_STOP_DECELERATION: robot.emergency_deceleration_mps2 / robot.wheel_radius_m,
        loops.P_COGGING: settings.cogging_nm.drive,
        loops.P_COGGING_PER_REV: settings.cogging_per_rev.drive,
        loops.P_NOISE: settings.torque_noise_nm.drive,
    }


def _steering(robot: Robot, params: SimParams) -> dict[int, float]:
    steer, settings = robot.steer, params.drives
    loop: PositionLoop = settings.steer
    rows = _speed_loop(loop, steer, steer.max_rate_radps, params)
    return rows | {
        loops.P_RAD_PER_COUNT: _TURN_RAD / steer.counts_per_turn,
        loops.P_POSITION_GAIN: loop.position_gain_per_s,
        loops.P_FRICTION: params.steering.friction_nm,
        loops.P_STOP_DECELERATION: steer.max_acceleration_radps2,
        loops.P_COGGING: settings.cogging_nm.steer,
        loops.P_COGGING_PER_REV: settings.cogging_per_rev.steer,
        loops.P_NOISE: settings.torque_noise_nm.steer,
    }


def _set(names: set[str], name: str, present: bool) -> None:
    """Adds or removes the name."""
    (names.add if present else names.discard)(name)


def _copy(source: DriveCommands, target: DriveCommands) -> None:
    target.servo_on[:] = source.servo_on
    target.mode[:] = source.mode
    target.position_counts[:] = source.position_counts
    target.velocity_counts_per_s[:] = source.velocity_counts_per_s
    target.clear_alarm[:] = source.clear_alarm
