"""The simulated motion engine: state machine, cycle and commands, without a clock, a socket or a file.

One engine serves many devices (clients). ``cycle`` is one interrupt of the real engine: plans advance, the bus is
exchanged, feedback is read. The caller sets the pace, in real time or in lockstep with physics.

Where the vendor's documentation is silent, the conservative reading is built: stopping communication with axes in
motion ends the motion and switches the servos off; the Final emergency stop switches the servos off at once; every
command that starts motion, homes or switches a servo on is refused during an emergency stop; a servo that drops out by
itself has to be switched on again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from robot_stack.wmx.api.enums import (
    AxisCommandMode,
    Config_EStopLevel1Type,
    EngineState,
    EStopLevel,
    OperationState,
)
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.bus import DriveCommands, DriveFeedback, ServoBus
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server import checks, homing, rows
from robot_stack.wmx.engine_server.devices import REPORT_S, TURNS, Device, DeviceTable
from robot_stack.wmx.engine_server.kernel import absorb, advance, cancel
from robot_stack.wmx.engine_server.motion import MotionControl
from robot_stack.wmx.engine_server.network import Network
from robot_stack.wmx.engine_server.parameter_set import ParameterSet, rescale
from robot_stack.wmx.engine_server.parameters import Parameters
from robot_stack.wmx.engine_server.state import Condition, EngineArrays

_NO_ERROR = int(ErrorCode.PyNone)
_OFFLINE = int(ErrorCode.ServoOffline)


class Engine:
    """See the module. All methods return codes; ``device`` is the id of the caller."""

    def __init__(self, config: EngineConfig, bus: ServoBus) -> None:
        if bus.n_axes != config.n_axes:
            raise ValueError(f"bus.n_axes must be {config.n_axes} as configured, is {bus.n_axes}")
        self.config = config
        self.condition = Condition(config.cycle_time_s)
        self.arrays = EngineArrays.of(config.n_axes)
        self.devices = DeviceTable()
        self.parameters = Parameters(config, self.arrays)
        self.parameter_set = ParameterSet(self.parameters, self.arrays)
        self.motion = MotionControl(self.arrays, self.condition)
        self.commands = DriveCommands.zeros(config.n_axes, config.n_output_bytes)
        self.feedback = DriveFeedback.zeros(config.n_axes, config.n_input_bytes)
        self.network = Network(self.condition)
        self._bus = bus
        self._starting_cycles = 0
        self._shutdown_cycles = 0
        self._lost_in_a_row = 0
        self._may_quit = False
        self._turn_cycles = max(1, round(REPORT_S / TURNS / config.cycle_time_s))
        self.auto_quit = config.quit_without_devices
        self.alive: Callable[[int], bool] = lambda device: True
        """Whether the process that owns a device runs; set by the server of clients in other processes."""
        self._warm_up()

    # -- cycle ---------------------------------------------------------------------------------------------------------

    def cycle(self) -> None:
        """One cycle of the engine."""
        condition = self.condition
        condition.cycles += 1
        if condition.cycles % self._turn_cycles == 0:
            self._watch_devices()
        if condition.communicating or self._starting_cycles:
            self._exchange()
        elif condition.state is EngineState.Shutdown:
            self._shutdown_cycles -= 1
            if self._shutdown_cycles <= 0:
                condition.state = EngineState.Idle
        if self._may_quit:
            self._quit_without_devices()

    def _watch_devices(self) -> None:
        """An expired watchdog only closes its device: axes continue as commanded."""
        condition = self.condition
        self.devices.report(self.alive, condition.cycles // self._turn_cycles, condition.cycles)
        for device in self.devices.expired(condition.cycles, condition.cycle_time_s):
            self.remove_device(device)

    def _exchange(self) -> None:
        self._advance()
        if not self._bus.exchange(self.commands, self.feedback):
            self._bus_silent()
            return
        self._lost_in_a_row = 0
        self._absorb()
        self.motion.splines.watch()
        if self._starting_cycles:
            self._starting_cycles -= 1
            if not self._starting_cycles:
                self._communicate()
        elif self.parameters.emergency_stop.enableEStopSignal:
            self._check_estop_signal()

    def _advance(self) -> None:
        self.motion.splines.advance()
        advance(self.arrays, self.condition.cycle_time_s, self.commands)

    def _absorb(self) -> None:
        absorb(self.arrays, self.condition.emergency_stop, self.feedback)

    def _warm_up(self) -> None:
        """Compiles or loads all compiled code now: in the middle of a ride it would halt the cycle for seconds."""
        self._advance()
        self._absorb()
        self.motion.warm_up()
        cancel(self.arrays.reals, self.arrays.flags, self.arrays.work, 0, _OFFLINE)
        self._reset()

    def _bus_silent(self) -> None:
        self.condition.lost_cycles += 1
        if self._starting_cycles:
            self._starting_cycles = self.config.timing.communication_start_cycles
            return
        self._lost_in_a_row += 1
        if self._lost_in_a_row > self.config.timing.bus_lost_cycles:
            self.condition.error = ErrorCode.ServoOffline
            self._leave_communication()

    def _communicate(self) -> None:
        self.condition.state = EngineState.Communicating
        self.condition.error = _NO_ERROR
        self.condition.lost_cycles = 0
        for axis in range(self.arrays.n_axes):
            if self.parameters.absolute(axis):
                self.arrays.flags[Flag.HOME_DONE, axis] = 1

    def _leave_communication(self) -> None:
        """Ends motion, servos off, inputs unknown. Positions keep their last values."""
        a = self.arrays
        self.condition.state = EngineState.Running
        self._starting_cycles = 0
        self._lost_in_a_row = 0
        for axis in range(a.n_axes):
            cancel(a.reals, a.flags, a.work, axis, _OFFLINE)
            if self.parameters.home(axis).clearHomeDoneOnCommStop:
                a.flags[Flag.HOME_DONE, axis] = 0
        self.motion.splines.forget_runs()
        a.flags[Flag.SERVO_ON] = 0
        a.flags[Flag.SERVO_REQUESTED] = 0
        a.flags[Flag.SERVO_OFFLINE] = 1
        a.flags[Flag.COMMAND_READY] = 0
        a.flags[Flag.OWNER] = 0
        a.work[rows.CLEAR_CYCLES] = 0
        a.reals[Real.ACTUAL_VELOCITY] = 0.0
        a.reals[Real.ACTUAL_TORQUE] = 0.0
        self.feedback.inputs.fill(0)
        self.commands.servo_on.fill(False)
        self.commands.velocity_counts_per_s.fill(0.0)

    def _check_estop_signal(self) -> None:
        if self._estop_signal_on():
            level = EStopLevel(self.parameters.emergency_stop.eStopSignalLevel)
            if not self.condition.emergency_stop or level < self.condition.emergency_stop_level:
                self._emergency_stop(level)

    def _estop_signal_on(self) -> bool:
        block = self.parameters.emergency_stop
        bit = bool(self.feedback.inputs[block.eStopSignalByteAddress] >> block.eStopSignalBitAddress & 1)
        return bit != block.invertEStopSignalPolarity

    def _quit_without_devices(self) -> None:
        """Stops an engine without devices, even in motion: its drives are then uncontrolled, as after any stop."""
        self._may_quit = False
        if not len(self.devices) and self.auto_quit:
            self.stop_engine()

    # -- engine and devices --------------------------------------------------------------------------------------------

    @property
    def at_rest(self) -> bool:
        """No axis is moving by a command."""
        return not self.arrays.flags[Flag.OP_STATE].any()

    def start_engine(self) -> int:
        """Idle becomes Running with the configuration's parameters; no effect on a running engine."""
        if self.condition.state is EngineState.Shutdown:
            return ErrorCode.EngineNotStartedInSpecifiedTime
        if self.condition.state is EngineState.Idle:
            self._reset()
            self.condition.state = EngineState.Running
        return _NO_ERROR

    def stop_engine(self) -> int:
        """Ends communication, drops devices, parameters and outputs. The process stays, in Idle."""
        if self.condition.state in (EngineState.Idle, EngineState.Shutdown):
            return _NO_ERROR
        self.stop_communication()
        self.devices.clear()
        self._reset()
        self._shutdown_cycles = self.config.timing.shutdown_cycles
        self.condition.state = EngineState.Shutdown
        self.condition.epoch += 1
        return _NO_ERROR

    def create_device(self, device_type: int) -> tuple[int, Device | None]:
        """A new device; the first one starts the engine."""
        code = self.start_engine()
        if code:
            return code, None
        device = self.devices.create(device_type, self.condition.cycles)
        if device is None:
            return ErrorCode.ReachMaxChannelNumber, None
        self._may_quit = False
        return _NO_ERROR, device

    def remove_device(self, device_id: int) -> None:
        """A device closed, or its watchdog expired: its motion continues; the engine may end with its last
        device.
        """
        if self.devices.remove(device_id):
            self._may_quit = not len(self.devices)

    def start_communication(self) -> int:
        """Begins to start the bus; it is up some cycles later, or never if the bus does not answer."""
        if self.condition.communicating:
            return _NO_ERROR
        if self.condition.state is not EngineState.Running:
            return ErrorCode.StartCommunicationError
        if not self._starting_cycles:
            self._starting_cycles = self.config.timing.communication_start_cycles
        return _NO_ERROR

    def stop_communication(self) -> int:
        """Ends the bus with one last exchange that switches every servo off."""
        if self.condition.communicating or self._starting_cycles:
            self._leave_communication()
            self._bus.exchange(self.commands, self.feedback)
            self.feedback.inputs.fill(0)
        return _NO_ERROR

    def _reset(self) -> None:
        self.arrays.clear()
        self.motion.splines.clear()
        self.parameters.reset()
        self.parameter_set.reset()
        fresh = Condition(self.config.cycle_time_s)
        self.condition.error = fresh.error
        self.condition.emergency_stop = fresh.emergency_stop
        self.condition.emergency_stop_level = fresh.emergency_stop_level
        self.condition.lost_cycles = fresh.lost_cycles
        self.auto_quit = self.config.quit_without_devices
        self._may_quit = False
        self.commands.outputs.fill(0)
        self.commands.servo_on.fill(False)
        self.feedback.inputs.fill(0)

    # -- emergency stop ------------------------------------------------------------------------------------------------

    def exec_estop(self, level: int) -> int:
        """Accepted in every state of engine and axes; latched. A lower level does not replace a higher one."""
        if level not in (EStopLevel.Final, EStopLevel.Level1):
            return ErrorCode.ArgumentOutOfRange
        if self.condition.emergency_stop and level > self.condition.emergency_stop_level:
            return CoreMotionErrorCode.CurrentEmergencyStopLevelIsHigher
        self._emergency_stop(EStopLevel(level))
        return _NO_ERROR

    def release_estop(self) -> int:
        """Allows commands again; refused while the input signal is on. It starts no motion."""
        signal = self.parameters.emergency_stop.enableEStopSignal and self.condition.communicating
        if self.condition.emergency_stop and signal and self._estop_signal_on():
            return CoreMotionErrorCode.EmergencyStopSignalOn
        self.condition.emergency_stop = False
        self.condition.emergency_stop_level = EStopLevel.Level1
        return _NO_ERROR

    def _emergency_stop(self, level: EStopLevel) -> None:
        self.condition.emergency_stop = True
        self.condition.emergency_stop_level = level
        final = level is EStopLevel.Final
        off = self.parameters.emergency_stop.eStopLevel1Type == Config_EStopLevel1Type.DecServoOff
        self.motion.emergency_stop(servo_off=off or final)
        self.arrays.flags[Flag.COMMAND_READY] = 0
        if final:
            self.arrays.flags[Flag.SERVO_REQUESTED] = 0

    # -- axes ----------------------------------------------------------------------------------------------------------

    def set_servo_on(self, axes: Sequence[int], on: int) -> int:
        """A request to the drives."""
        code = self._reachable(axes)
        if code:
            return code
        if on not in (0, 1):
            return ErrorCode.ArgumentOutOfRange
        flags = self.arrays.flags
        if on:
            if self.condition.emergency_stop:
                return CoreMotionErrorCode.EmergencyStopSignalOn
            if any(flags[Flag.AMP_ALARM, axis] for axis in axes):
                return ErrorCode.AxisAmpAlarm
            if any(flags[Flag.FOLLOWING_ERROR_ALARM, axis] for axis in axes):
                return CoreMotionErrorCode.ServoOnError
        for axis in axes:
            if on and not flags[Flag.SERVO_REQUESTED, axis]:
                self.arrays.work[rows.SERVO_DELAY, axis] = self.config.timing.servo_on_delay_cycles
            flags[Flag.SERVO_REQUESTED, axis] = on
        return _NO_ERROR

    def clear_amp_alarm(self, axes: Sequence[int]) -> int:
        """A request to the drives, held for some cycles."""
        code = self._reachable(axes)
        if not code:
            for axis in axes:
                self.arrays.work[rows.CLEAR_CYCLES, axis] = self.config.timing.clear_alarm_cycles
        return code

    def clear_axis_alarm(self, axes: Sequence[int]) -> int:
        """Clears following errors; they return if their cause persists."""
        code = self._reachable(axes)
        if not code:
            for axis in axes:
                self.arrays.flags[Flag.FOLLOWING_ERROR_ALARM, axis] = 0
                self.arrays.work[rows.VELOCITY_ERROR_COUNT, axis] = 0
        return code

    def set_mode(self, axis: int, mode: int) -> int:
        """Position or velocity mode; the axis must be idle."""
        code = checks.axes_in_range([axis], self.arrays.n_axes)
        if code:
            return code
        if mode == AxisCommandMode.Torque:
            return CoreMotionErrorCode.CurrentAxisCommandModeNotSupported
        if mode not in (AxisCommandMode.Position, AxisCommandMode.Velocity):
            return CoreMotionErrorCode.AxisCommandModeOutOfRange
        if not self._idle(axis):
            return ErrorCode.NotIdleState
        reals = self.arrays.reals
        self.arrays.flags[Flag.COMMAND_MODE, axis] = mode
        reals[Real.POS_CMD, axis] = reals[Real.PROFILE_TARGET_POS, axis] = reals[Real.ACTUAL_POS, axis]
        return _NO_ERROR

    def start_home(self, axes: Sequence[int]) -> int:
        """Homes by the axes' home parameters. All axes or none."""
        code = self._reachable(axes)
        if code:
            return code
        if self.condition.emergency_stop:
            return CoreMotionErrorCode.EmergencyStopSignalOn
        return homing.start(self.arrays, self.parameters, axes)

    def cancel_home(self, axis: int) -> int:
        """No effect: a homing to the present position is over at once."""
        return checks.axes_in_range([axis], self.arrays.n_axes)

    def set_position(self, axis: int, row: Real, position: float) -> int:
        """Renames the present position of an axis, commanded (row POS_CMD) or measured (ACTUAL_POS)."""
        code = self._reachable([axis])
        if code:
            return code
        code = checks.target(position, self.arrays.params[rows.COUNTS_PER_UNIT, axis], 0.0)
        if code:
            return code
        if not self._idle(axis):
            return ErrorCode.NotIdleState
        homing.rename(self.arrays, axis, row, position)
        return _NO_ERROR

    def set_gear(self, axis: int, numerator: float, denominator: float) -> int:
        """Counts per user unit. The zero moves with it, nothing else does."""
        code = checks.axes_in_range([axis], self.arrays.n_axes)
        if code:
            return code
        if not self._idle(axis):
            return ErrorCode.NotIdleState
        code = self.parameters.set_gear(axis, numerator, denominator)
        if not code:
            rescale(self.arrays, axis)
        return code

    def set_polarity(self, axis: int, polarity: int) -> int:
        code = checks.axes_in_range([axis], self.arrays.n_axes)
        if code:
            return code
        if not self._idle(axis):
            return ErrorCode.NotIdleState
        code = self.parameters.set_polarity(axis, polarity)
        if not code:
            rescale(self.arrays, axis)
        return code

    def set_outputs(self, byte: int, values: Sequence[int]) -> int:
        """Digital outputs from byte ``byte`` on."""
        if not self.condition.communicating:
            return ErrorCode.CommNotStarted
        outputs = self.commands.outputs
        if not 0 <= byte < outputs.size:
            return ErrorCode.IOAddressOutOfRange
        if not 0 < len(values) <= outputs.size - byte:
            return ErrorCode.IOSizeOutOfRange
        if any(not 0 <= value <= 255 for value in values):
            return ErrorCode.ArgumentOutOfRange
        outputs[byte : byte + len(values)] = values
        return _NO_ERROR

    def set_output_bit(self, byte: int, bit: int, value: int) -> int:
        """One digital output."""
        if not 0 <= byte < self.commands.outputs.size or not 0 <= bit < 8:
            return ErrorCode.IOAddressOutOfRange if self.condition.communicating else ErrorCode.CommNotStarted
        if value not in (0, 1):
            return ErrorCode.ArgumentOutOfRange
        present = int(self.commands.outputs[byte])
        return self.set_outputs(byte, [present | 1 << bit if value else present & ~(1 << bit)])

    def _reachable(self, axes: Sequence[int]) -> int:
        if not self.condition.communicating:
            return ErrorCode.CommNotStarted
        return checks.axes_in_range(axes, self.arrays.n_axes)

    def _idle(self, axis: int) -> bool:
        return bool(self.arrays.flags[Flag.OP_STATE, axis] == OperationState.Idle)
