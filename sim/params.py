"""Parameters of the simulated plant, ``config/sim.yaml``: physics, drives and sensors beyond ``config/robot.yaml``."""

from __future__ import annotations

import itertools
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Fraction, NotNegative, Positive, load


class Physics(Config):
    """Solver settings of MuJoCo."""

    timestep_s: Annotated[float, Field(gt=0.0, le=0.004)]
    friction_ratio: Annotated[float, Field(ge=1.0, le=1000.0)]
    contact_time_s: Positive
    contact_sink_m: NotNegative
    solver_iterations: Annotated[int, Field(ge=1, le=200)]

    @model_validator(mode="after")
    def _contact_is_resolved(self) -> Physics:
        if self.contact_time_s < 2.0 * self.timestep_s:
            raise ValueError("contact_time_s must be at least two timesteps, else MuJoCo softens the contacts silently")
        return self


class Wheel(Config):
    """One driven wheel. Friction torques at the wheel axis."""

    contact_patch_radius_m: Positive
    rolling_friction_nm: Positive
    viscous_friction_nms: NotNegative
    rotor_inertia_kgm2: NotNegative
    radius_tolerance: Annotated[float, Field(ge=0.0, le=0.02)]


class Steering(Config):
    """One steering module at its vertical axis."""

    friction_nm: Positive
    viscous_friction_nms: NotNegative
    rotor_inertia_kgm2: NotNegative
    mass_above_axle_m: float
    zero_error_rad: Annotated[float, Field(ge=0.0, le=0.1)]


class Suspension(Config):
    """Vertical compliance of one module."""

    stiffness_n_per_m: Positive
    damping_ratio: NotNegative
    travel_m: Positive


class Wheelchair(Config):
    """The wheelchair. Frame: origin on the ground under the board, x the way a robot approaches, z up."""

    board_width_m: Positive
    board_height_m: Positive
    board_middle_m: Positive
    seat_length_m: Positive
    seat_width_m: Positive
    seat_top_m: Positive
    rail_length_m: Positive
    rail_inner_m: Positive
    rail_outer_m: Positive
    rail_bottom_m: Positive
    rail_top_m: Positive
    castor_front_x_m: float
    castor_rear_x_m: float
    castor_track_m: Positive
    castor_radius_m: Positive
    rolling_resistance: Fraction
    brake_friction: Fraction
    centre_of_gravity_x_m: float
    centre_of_gravity_height_m: Positive
    passenger_centre_of_gravity_height_m: Positive

    @model_validator(mode="after")
    def _stands(self) -> Wheelchair:
        if not self.castor_rear_x_m < self.centre_of_gravity_x_m < self.castor_front_x_m:
            raise ValueError("centre_of_gravity_x_m must lie between the castors, else the chair falls over")
        if self.rail_outer_m <= self.rail_inner_m or self.rail_top_m <= self.rail_bottom_m:
            raise ValueError("rail_outer_m and rail_top_m must be above rail_inner_m and rail_bottom_m")
        if self.brake_friction <= self.rolling_resistance:
            raise ValueError("brake_friction must be above rolling_resistance")
        return self


class LatchMechanism(Config):
    """The robot's latch: two hooks that take the rail ends of a wheelchair. plate_*: from the hook."""

    plate_length_m: Positive
    plate_inwards_m: Positive
    plate_outwards_m: Positive
    plate_height_m: Positive
    travel_s: Positive
    draw_in_s: Positive
    capture_m: Positive
    capture_rad: Positive
    capture_height_m: Positive


class PerMotor(Config):
    """A value for each kind of motor."""

    drive: NotNegative
    steer: NotNegative


class CoggingPerRev(Config):
    """Cogging periods in one turn of the joint."""

    drive: Annotated[int, Field(ge=1)]
    steer: Annotated[int, Field(ge=1)]


class SpeedLoop(Config):
    """Velocity loop of one kind of servo drive: PI with acceleration feed-forward on an observed speed."""

    speed_gain_nms: Positive
    speed_integral_per_s: NotNegative
    acceleration_feedforward_kgm2: NotNegative
    observer_bandwidth_radps: Positive
    constant_torque_speed_radps: Positive


class PositionLoop(SpeedLoop):
    """A position loop around a velocity loop."""

    position_gain_per_s: Positive


class Drives(Config):
    """The servo drives."""

    bus_watchdog_s: Positive
    servo_on_delay_s: NotNegative
    alarm_clear_delay_s: NotNegative
    brake_release_delay_s: NotNegative
    brake_hold_delay_s: Positive
    brake_close_speed_radps: Positive
    brake_close_timeout_s: Positive
    overload_fraction: Annotated[float, Field(gt=0.0, le=1.0)]
    overload_time_s: Positive
    overspeed_factor: Annotated[float, Field(gt=1.0)]
    position_error_rad: Positive
    dynamic_brake_nms: Positive
    cogging_nm: PerMotor
    cogging_per_rev: CoggingPerRev
    torque_noise_nm: PerMotor
    drive: SpeedLoop
    steer: PositionLoop


class Imu(Config):
    """Noise model of the inertial unit; standard deviations."""

    latency_s: NotNegative
    accelerometer_noise_mps2: NotNegative
    accelerometer_bias_mps2: NotNegative
    accelerometer_bias_walk_mps2_per_sqrt_s: NotNegative
    gyroscope_noise_radps: NotNegative
    gyroscope_bias_radps: NotNegative
    gyroscope_bias_walk_radps_per_sqrt_s: NotNegative
    attitude_error_rad: NotNegative
    attitude_error_time_s: Positive
    heading_walk_rad_per_sqrt_s: NotNegative


class Battery(Config):
    """A lithium-ion pack and what it feeds."""

    cells_in_series: Annotated[int, Field(ge=1)]
    capacity_ah: Positive
    initial_charge: Fraction
    charge: tuple[Fraction, ...]
    cell_voltage_v: tuple[Positive, ...]
    internal_resistance_ohm: Positive
    idle_power_w: NotNegative
    drive_efficiency: Annotated[float, Field(gt=0.0, le=1.0)]
    copper_loss_w_per_nm2: PerMotor
    temperature_c: float
    voltage_noise_v: NotNegative

    @model_validator(mode="after")
    def _curve_rises(self) -> Battery:
        if len(self.charge) != len(self.cell_voltage_v) or len(self.charge) < 2:
            raise ValueError("charge and cell_voltage_v must be equally long, two points or more")
        for name, values in (("charge", self.charge), ("cell_voltage_v", self.cell_voltage_v)):
            if any(b <= a for a, b in itertools.pairwise(values)):
                raise ValueError(f"{name} must rise from point to point")
        return self


class SimParams(Config):
    """Everything in ``config/sim.yaml``."""

    physics: Physics
    wheel: Wheel
    steering: Steering
    suspension: Suspension
    wheelchair: Wheelchair
    latch: LatchMechanism
    drives: Drives
    imu: Imu
    battery: Battery


def load_sim_params() -> SimParams:
    """``config/sim.yaml``. Raises ConfigError."""
    return load(SimParams, "sim")
