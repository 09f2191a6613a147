"""The engine's configuration, ``config/wmx_engine.yaml``: cycle, axes, stops, alarms, I/O.

Axes share a handful of kinds (the robot has two: drive and steer), so the file describes kinds and lists the axes by
kind. User unit is rad throughout.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, ConfigError, config_dir, load, read_yaml, validate
from robot_stack.core.pacing import SpinLimits
from robot_stack.core.robot import Robot, load_robot
from robot_stack.wmx.api.values import MAX_AXES, MAX_IO_BYTES

ENGINE_VARIABLE = "ROBOT_STACK_WMX_ENGINE"
"""Set by a profile, because the engine depends on the running machine, and the file on the installation."""
ENGINE_CONFIG_VARIABLE = "ROBOT_STACK_WMX_ENGINE_CONFIG"
"""The file of config/ with the simulated engine's axes: a machine's own, by its name without .yaml."""
STALE_VARIABLE = "ROBOT_STACK_WMX_STATUS_STALE_S"
# A paused engine also pauses /clock, so its status ages by the system's clock alone.
HELD_UP_STALE_S = 2.0

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Bit = Annotated[int, Field(ge=0, lt=8)]


class FollowingError(Config):
    """Limits of the difference of command and feedback. 0 switches a check off; ``quick_stop`` false only reports."""

    moving_rad: NotNegative
    stopped_rad: NotNegative
    velocity_moving_radps: NotNegative
    velocity_stopped_radps: NotNegative
    velocity_time_s: NotNegative
    quick_stop: bool


class SoftLimits(Config):
    """Travel of a homed axis. ``dec_radps2`` decelerates an axis that runs into one."""

    negative_rad: float
    positive_rad: float
    dec_radps2: Positive

    @model_validator(mode="after")
    def _in_order(self) -> SoftLimits:
        if self.negative_rad >= self.positive_rad:
            raise ValueError("negative_rad must be below positive_rad")
        return self


class LimitSwitches(Config):
    """The engine's response when an axis runs into a limit switch of its drive."""

    action: Literal["none", "servo_off", "dec_servo_off", "dec", "slow_dec_servo_off", "slow_dec"]
    dec_radps2: Positive
    slow_dec_radps2: Positive


class Homing(Config):
    """Speeds of a homing motion; a client sets the type of homing."""

    fast_radps: Positive
    slow_radps: Positive
    acceleration_radps2: Positive


class AxisKind(Config):
    """One kind of axis. Encoder counts = rad * gear_numerator / gear_denominator * polarity.

    ``limit_switches`` and ``homing`` are for a parameter file only, because no simulated drive has a switch; null: the
    vendor's defaults.
    """

    mode: Literal["position", "velocity"]
    gear_numerator: Annotated[float, Field(ge=1e-6, le=2147483647.0)]
    gear_denominator: Annotated[float, Field(ge=1e-6, le=2147483647.0)]
    polarity: Literal[1, -1]
    absolute_encoder: bool
    home_offset_rad: float
    in_pos_width_rad: Positive
    pos_set_width_rad: Positive
    quick_stop_dec_radps2: Positive
    estop_dec_radps2: Positive
    servo_off_during_alarm: bool
    following_error: FollowingError
    soft_limits: SoftLimits | None
    limit_switches: LimitSwitches | None = None
    homing: Homing | None = None

    @model_validator(mode="after")
    def _one_deceleration(self) -> AxisKind:
        both = self.soft_limits is not None and self.limit_switches is not None
        if both and self.soft_limits.dec_radps2 != self.limit_switches.dec_radps2:  # type: ignore[union-attr]
            raise ValueError("soft_limits.dec_radps2 and limit_switches.dec_radps2 must be equal: the engine has one")
        return self

    @property
    def counts_per_rad(self) -> float:
        """Signed by the polarity."""
        return self.polarity * self.gear_numerator / self.gear_denominator


class Axis(Config):
    name: Annotated[str, Field(min_length=1)]
    kind: str


class EStopSignal(Config):
    """An input bit that stops the engine by itself. ``active`` is the bit's value when pressed."""

    enabled: bool
    byte: Annotated[int, Field(ge=0, lt=MAX_IO_BYTES)]
    bit: Bit
    active: Literal[0, 1]
    level: Literal["level1", "final"]


class Timing(Config):
    """Durations of the engine's operations, in cycles."""

    servo_on_delay_cycles: Annotated[int, Field(ge=0)]
    clear_alarm_cycles: Annotated[int, Field(ge=1)]
    communication_start_cycles: Annotated[int, Field(ge=1)]
    bus_lost_cycles: Annotated[int, Field(ge=1)]
    shutdown_cycles: Annotated[int, Field(ge=1)]


class Server(Config):
    """The engine process's limits for clients and clock. ``spin`` null: it sleeps until its cycles are due."""

    create_device_s: NotNegative
    pause_publish_s: Positive
    max_clients: Annotated[int, Field(ge=1, le=256)]
    shutdown_stop_s: NotNegative
    spin: SpinLimits | None = None


class EngineConfig(Config):
    """The whole file. ``n_axes`` is the number of axes listed."""

    cycle_time_s: Annotated[float, Field(gt=0.0, le=0.1)]
    n_input_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]
    n_output_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]
    quit_without_devices: bool
    estop_servo_off: bool
    estop_signal: EStopSignal
    timing: Timing
    server: Server
    kinds: dict[str, AxisKind]
    axes: Annotated[tuple[Axis, ...], Field(min_length=1, max_length=MAX_AXES)]

    @model_validator(mode="after")
    def _consistent(self) -> EngineConfig:
        for index, axis in enumerate(self.axes):
            if axis.kind not in self.kinds:
                raise ValueError(f"axes.{index}.kind: {axis.kind!r} is none of {sorted(self.kinds)}")
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names):
            raise ValueError("axes: names must differ")
        if self.estop_signal.byte >= self.n_input_bytes:
            raise ValueError("estop_signal.byte must be below n_input_bytes")
        return self

    @property
    def n_axes(self) -> int:
        return len(self.axes)

    def axis_kind(self, axis: int) -> AxisKind:
        """The kind of axis number ``axis``."""
        return self.kinds[self.axes[axis].kind]


class ClientConfig(Config):
    """A client's settings, ``config/wmx_client.yaml``: the engine, its location, and timeouts."""

    engine: Literal["simulated", "vendor"]
    path: str
    library_path: str
    call_timeout_s: Positive
    status_stale_s: Positive
    connect_timeout_s: Positive
    lock_retry_s: Positive
    vendor_axes: Annotated[int, Field(ge=1, le=MAX_AXES)]
    vendor_io_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]

    @model_validator(mode="after")
    def _vendor_has_a_root(self) -> ClientConfig:
        if self.engine == "vendor" and not self.path:
            raise ValueError("path must name the installation of the vendor's engine, e.g. /opt/lmx/")
        return self


def load_engine_config() -> EngineConfig:
    """``config/wmx_engine.yaml``, or the file of config/ that ENGINE_CONFIG_VARIABLE names. Raises ConfigError."""
    return read_engine_config(config_dir() / f"{os.environ.get(ENGINE_CONFIG_VARIABLE) or 'wmx_engine'}.yaml")


def read_engine_config(path: Path) -> EngineConfig:
    """One file that describes an engine; ``robot_motor`` and ``robot_input`` take values from ``config/robot.yaml``.

    Raises ConfigError.
    """
    data = read_yaml(path)
    kinds = data.get("kinds")
    if isinstance(kinds, dict):
        data["kinds"] = {name: _of_robot(kind, str(path)) for name, kind in kinds.items()}
    data["estop_signal"] = _signal_of_robot(data.get("estop_signal"), str(path))
    return validate(EngineConfig, data, str(path))


def _signal_of_robot(signal: Any, source: str) -> Any:
    """The input that stops the engine, completed from ``config/robot.yaml`` if it names one of the robot's inputs.

    A robot without a safety edge has no such input.
    """
    if not isinstance(signal, dict) or "robot_input" not in signal:
        return signal
    own = {name: value for name, value in signal.items() if name != "robot_input"}
    if signal["robot_input"] != "safety_edge":
        raise ConfigError(f"{source}: estop_signal.robot_input must be safety_edge, is {signal['robot_input']!r}")
    edge = load_robot().safety_edge
    byte, bit = (0, 0) if edge is None else (edge.byte, edge.relay_input_bit)
    return {"enabled": edge is not None, "byte": byte, "bit": bit, "active": 0} | own


def _of_robot(kind: Any, source: str) -> Any:
    """A kind of axis, completed from ``config/robot.yaml`` if it names one of the robot's motors."""
    if not isinstance(kind, dict) or "robot_motor" not in kind:
        return kind
    own = {name: value for name, value in kind.items() if name != "robot_motor"}
    motor, derived = kind["robot_motor"], _DERIVED.get(str(kind["robot_motor"]))
    if derived is None:
        raise ConfigError(f"{source}: robot_motor must be one of {', '.join(_DERIVED)}, is {motor!r}")
    counts, deceleration_radps2 = derived(load_robot())
    gear = {"gear_numerator": counts, "gear_denominator": math.tau}
    return gear | dict.fromkeys(("quick_stop_dec_radps2", "estop_dec_radps2"), deceleration_radps2) | own


# Counts per turn, and deceleration of a stop: a wheel's as in the robot's emergency stop, a steering axis' own limit.
_DERIVED: Final[dict[str, Callable[[Robot], tuple[float, float]]]] = {
    "drive": lambda robot: (
        float(robot.drive.encoder_counts_per_rev),
        robot.emergency_deceleration_mps2 / robot.wheel_radius_m,
    ),
    "steer": lambda robot: (float(robot.steer.encoder_counts_per_rev), robot.steer.max_acceleration_radps2),
}


def load_client_config() -> ClientConfig:
    """``config/wmx_client.yaml``, changed by ENGINE_VARIABLE and STALE_VARIABLE where set. Raises ConfigError."""
    named = {"engine": os.environ.get(ENGINE_VARIABLE), "status_stale_s": os.environ.get(STALE_VARIABLE)}
    return load(ClientConfig, "wmx_client", {key: value for key, value in named.items() if value})
