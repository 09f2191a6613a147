"""The engine's configuration, ``config/wmx_engine.yaml``: cycle, I/O, axes and the parameters with which they start.

Axes share a handful of kinds, so a file describes kinds and lists the axes by kind. User unit is rad throughout. The
robot's engine has no kinds: it starts with the vendor's defaults, and the drive imports its parameters
(``robot_parameters``).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, NotNegative, Positive, config_dir, load, read_yaml, validate
from robot_stack.core.pacing import SpinLimits
from robot_stack.core.robot import load_robot
from robot_stack.wmx.api.values import MAX_AXES, MAX_IO_BYTES

ENGINE_VARIABLE = "ROBOT_STACK_WMX_ENGINE"
"""Set by a profile, because the engine depends on the running machine, and the file on the installation."""
ENGINE_CONFIG_VARIABLE = "ROBOT_STACK_WMX_ENGINE_CONFIG"
"""The file of config/ with the simulated engine's axes: a machine's own, by its name without .yaml."""
STALE_VARIABLE = "ROBOT_STACK_WMX_STATUS_STALE_S"
# A paused engine also pauses /clock, so its status ages by the system's clock alone.
HELD_UP_STALE_S = 2.0

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
    """A homing motion: its type, its speeds, the direction of its search."""

    type: Literal["current_position", "home_switch"] = "current_position"
    direction: Literal["positive", "negative"] = "positive"
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


VENDOR_DEFAULTS: Final = AxisKind(
    mode="position",
    gear_numerator=1.0,
    gear_denominator=1.0,
    polarity=1,
    absolute_encoder=False,
    home_offset_rad=0.0,
    in_pos_width_rad=1000.0,
    pos_set_width_rad=1000.0,
    quick_stop_dec_radps2=100000.0,
    estop_dec_radps2=100000.0,
    servo_off_during_alarm=True,
    following_error=FollowingError(
        moving_rad=0.0,
        stopped_rad=0.0,
        velocity_moving_radps=0.0,
        velocity_stopped_radps=0.0,
        velocity_time_s=0.0,
        quick_stop=False,
    ),
    soft_limits=None,
)
"""Parameters of every axis of an engine that has just started. Its user unit is one encoder count, not one rad."""


class Axis(Config):
    """kind: of the parameters with which the engine starts; null for the vendor's defaults."""

    name: Annotated[str, Field(min_length=1)]
    kind: str | None = None


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


@dataclass(frozen=True, slots=True)
class EngineParameters:
    """Parameters of an engine. axes: by number. estop_servo_off: the emergency stop of level 1 ends with servos off."""

    axes: tuple[AxisKind, ...]
    estop_signal: EStopSignal | None = None
    estop_servo_off: bool = False


class EngineConfig(Config):
    """The whole file. ``n_axes`` is the number of axes listed."""

    cycle_time_s: Annotated[float, Field(gt=0.0, le=0.1)]
    n_input_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]
    n_output_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]
    quit_without_devices: bool
    estop_servo_off: bool = False
    estop_signal: EStopSignal | None = None
    timing: Timing
    server: Server
    kinds: dict[str, AxisKind] = {}
    axes: Annotated[tuple[Axis, ...], Field(min_length=1, max_length=MAX_AXES)]

    @model_validator(mode="after")
    def _consistent(self) -> EngineConfig:
        for index, axis in enumerate(self.axes):
            if axis.kind is not None and axis.kind not in self.kinds:
                raise ValueError(f"axes.{index}.kind: {axis.kind!r} is none of {sorted(self.kinds)}")
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names):
            raise ValueError("axes: names must differ")
        if self.estop_signal is not None and self.estop_signal.byte >= self.n_input_bytes:
            raise ValueError("estop_signal.byte must be below n_input_bytes")
        return self

    @property
    def n_axes(self) -> int:
        return len(self.axes)

    def axis_kind(self, axis: int) -> AxisKind:
        """The parameters with which axis number ``axis`` starts."""
        kind = self.axes[axis].kind
        return VENDOR_DEFAULTS if kind is None else self.kinds[kind]

    @property
    def parameters(self) -> EngineParameters:
        """The parameters with which the engine starts."""
        kinds = tuple(self.axis_kind(axis) for axis in range(self.n_axes))
        return EngineParameters(kinds, self.estop_signal, self.estop_servo_off)


class ClientConfig(Config):
    """A client's settings, ``config/wmx_client.yaml``: the engine, its location, and timeouts."""

    engine: Literal["simulated", "vendor"]
    path: str
    library_path: str
    bridge: str = ""
    call_timeout_s: Positive
    status_stale_s: Positive
    connect_timeout_s: Positive
    lock_retry_s: Positive
    vendor_axes: Annotated[int, Field(ge=1, le=MAX_AXES)]
    vendor_io_bytes: Annotated[int, Field(ge=1, le=MAX_IO_BYTES)]

    @model_validator(mode="after")
    def _vendor_has_a_root(self) -> ClientConfig:
        if self.engine == "vendor" and not (self.path or self.bridge):
            raise ValueError(
                "path must name the installation of the vendor's engine, e.g. /opt/lmx/, or bridge a folder"
            )
        return self

    @property
    def bridged(self) -> bool:
        """The vendor's engine runs behind the bridge, which a client reaches by the simulated engine's protocol."""
        return self.engine == "vendor" and bool(self.bridge)

    @property
    def device_path(self) -> str:
        """The path of CreateDevice."""
        return self.bridge if self.bridged else self.path


def load_engine_config() -> EngineConfig:
    """``config/wmx_engine.yaml``, or the file of config/ that ENGINE_CONFIG_VARIABLE names. Raises ConfigError."""
    return read_engine_config(config_dir() / f"{os.environ.get(ENGINE_CONFIG_VARIABLE) or 'wmx_engine'}.yaml")


def read_engine_config(path: Path) -> EngineConfig:
    """One file that describes an engine. ``axes: robot`` stands for those of ``config/robot.yaml``, without parameters.

    Raises ConfigError.
    """
    data = read_yaml(path)
    if data.get("axes") == "robot":
        names = {axis.number: name for name, axis in load_robot().axes.items()}
        data["axes"] = [{"name": names.get(number, f"axis{number}")} for number in range(max(names) + 1)]
    return validate(EngineConfig, data, str(path))


def load_client_config(engine: str | None = None) -> ClientConfig:
    """``config/wmx_client.yaml``, changed by ENGINE_VARIABLE and STALE_VARIABLE where set, and ``engine`` if given.

    Raises ConfigError.
    """
    named = {"engine": engine or os.environ.get(ENGINE_VARIABLE), "status_stale_s": os.environ.get(STALE_VARIABLE)}
    return load(ClientConfig, "wmx_client", {key: value for key, value in named.items() if value})
