"""Parameters of the simulated arm, ``config/sim_manipulator.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Fraction, NotNegative, Positive
from robot_stack.wmx.config import EngineConfig

N_JOINTS = 6


class Radii(Config):
    base: Positive
    arm: Positive
    wrist: Positive


class Masses(Config):
    base: Positive
    shoulder: Positive
    upper_arm: Positive
    forearm: Positive
    wrist1: Positive
    wrist2: Positive
    wrist3: Positive


class Body(Config):
    """Links. ``elbow_share``: of upper arm and forearm, the mass at their far joint; the rest is spread along them."""

    pedestal_m: NotNegative
    base_height_m: Positive
    upper_arm_m: Positive
    forearm_m: Positive
    wrist_offset_m: Positive
    wrist_m: Positive
    flange_m: Positive
    radius_m: Radii
    mass_kg: Masses
    elbow_share: Fraction


class Gripper(Config):
    """Two fingers that an output bit closes, each at ``speed_mps`` until ``force_n`` stops it."""

    mass_kg: Positive
    finger_mass_kg: Positive
    length_m: Positive
    finger_length_m: Positive
    stroke_m: Positive
    speed_mps: Positive
    force_n: Positive
    stiffness_n_per_m: Positive
    damping_ns_per_m: Positive
    output_byte: Annotated[int, Field(ge=0)]
    output_bit: Annotated[int, Field(ge=0, lt=8)]


class Cube(Config):
    """Stands on the table, edges along x and y; place of its middle from the base's."""

    edge_m: Positive
    mass_kg: Positive
    x_m: float
    y_m: float


class JointKind(Config):
    """Motor, gear, brake and loops of one size of joint, all at the joint's side of the gear."""

    encoder_counts_per_rev: Annotated[int, Field(ge=1)]
    max_torque_nm: Positive
    rated_torque_nm: Positive
    max_speed_radps: Positive
    constant_torque_speed_radps: Positive
    no_load_speed_radps: Positive
    armature_kgm2: Positive
    friction_nm: NotNegative
    viscous_friction_nms: NotNegative
    brake_torque_nm: Positive
    position_gain_per_s: Positive
    speed_gain_nms: Positive
    speed_integral_per_s: NotNegative
    acceleration_feedforward_kgm2: NotNegative
    stop_deceleration_radps2: Positive

    @model_validator(mode="after")
    def _plausible(self) -> JointKind:
        if self.rated_torque_nm > self.max_torque_nm:
            raise ValueError("rated_torque_nm must not exceed max_torque_nm")
        if not self.constant_torque_speed_radps < self.max_speed_radps < self.no_load_speed_radps:
            raise ValueError("constant_torque_speed_radps, max_speed_radps, no_load_speed_radps must increase")
        return self


class Joint(Config):
    name: Annotated[str, Field(min_length=1)]
    kind: str
    direction: Literal[1, -1]
    lower_rad: float
    upper_rad: float


class Drives(Config):
    """Parameters common to all drives."""

    observer_bandwidth_radps: Positive
    torque_lag_s: Positive
    dynamic_brake_nms: NotNegative
    servo_on_delay_s: NotNegative
    alarm_clear_delay_s: NotNegative
    brake_release_delay_s: NotNegative
    brake_engage_delay_s: NotNegative
    brake_preset: Fraction
    stop_timeout_s: Positive
    standstill_radps: Positive
    bus_watchdog_s: Positive
    overload_fraction: Fraction
    overload_time_s: Positive
    overspeed_factor: Annotated[float, Field(ge=1.0)]
    following_error_rad: Positive


class ArmParams(Config):
    """The whole file."""

    start_rad: Annotated[tuple[float, ...], Field(min_length=N_JOINTS, max_length=N_JOINTS)]
    body: Body
    gripper: Gripper
    payload_kg: NotNegative
    cube: Cube | None
    kinds: dict[str, JointKind]
    joints: Annotated[tuple[Joint, ...], Field(min_length=N_JOINTS, max_length=N_JOINTS)]
    drives: Drives

    @model_validator(mode="after")
    def _consistent(self) -> ArmParams:
        for index, (joint, start) in enumerate(zip(self.joints, self.start_rad, strict=True)):
            if joint.kind not in self.kinds:
                raise ValueError(f"joints.{index}.kind: {joint.kind!r} is none of {sorted(self.kinds)}")
            if not joint.lower_rad <= start <= joint.upper_rad:
                raise ValueError(f"start_rad.{index}: {start} is outside {joint.lower_rad} to {joint.upper_rad}")
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joints, by engine axis."""
        return tuple(joint.name for joint in self.joints)

    def kind(self, axis: int) -> JointKind:
        return self.kinds[self.joints[axis].kind]


def disagreement(params: ArmParams, engine: EngineConfig) -> str:
    """Mismatches of the engine's configuration and this arm's encoders, as text; empty without any."""
    if engine.n_axes != N_JOINTS:
        return f"axes: the arm has {N_JOINTS}, the engine {engine.n_axes}"
    for axis, joint in enumerate(params.joints):
        kind, other = params.kind(axis), engine.axis_kind(axis)
        if kind.encoder_counts_per_rev != other.gear_numerator or joint.direction != other.polarity:
            ours = f"{kind.encoder_counts_per_rev} counts, direction {joint.direction}"
            theirs = f"gear numerator {other.gear_numerator:g}, polarity {other.polarity}"
            return f"{joint.name}: the encoder has {ours}, the engine's axis {theirs}"
    return ""
