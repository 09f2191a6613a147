"""Physical parameters of the robot, ``config/robot.yaml``: geometry, masses, limits, sensor mounting."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from robot_stack.contract import frames
from robot_stack.core.config import Config, Positive, load
from robot_stack.core.range_sensor import RangeSensor

Bit = Annotated[int, Field(ge=0, lt=8)]
Xyz = Annotated[tuple[float, float, float], Field(description="m, base_link")]
_LARGEST_GEAR: Final = 2147483647
SIDES = ("front", "rear", "left", "right")
# A safety edge must be soft for longer than the robot needs to stop from this speed, with this time until it brakes.
CREEP_SPEED_MPS, EDGE_REACTION_S = 0.3, 0.1
# From the middle of a hook inwards to the front strip: half the thickness of a rail, and the 10 mm that the latch
# catches it off its place.
_RAIL_CLEARANCE_M = 0.03
Rpy = Annotated[tuple[float, float, float], Field(description="deg, about the fixed axes x, y, z of base_link")]


class Motion(Config):
    """Limits of a ride. Speeds m/s and rad/s, accelerations m/s2 and rad/s2, jerk m/s3 and rad/s3."""

    max_speed_mps: Positive
    max_yaw_rate_radps: Positive
    max_acceleration_mps2: Positive
    max_yaw_acceleration_radps2: Positive
    max_jerk_mps3: Positive
    max_yaw_jerk_radps3: Positive


class ModulePosition(Config):
    """Where a module's steering axis meets the ground, m, base_link."""

    x_m: float
    y_m: float


class Footprint(Config):
    """Rectangle in base_link, m: x from rear_m to front_m, y +-half of width_m."""

    front_m: Positive
    rear_m: Annotated[float, Field(lt=0.0)]
    width_m: Positive

    def corners(self) -> list[tuple[float, float]]:
        """Clockwise from the front left, base_link, m."""
        half_m = 0.5 * self.width_m
        return [(self.front_m, half_m), (self.front_m, -half_m), (self.rear_m, -half_m), (self.rear_m, half_m)]

    def inscribed_m(self) -> float:
        """Radius of the largest circle around base_link within the footprint."""
        return min(self.front_m, -self.rear_m, 0.5 * self.width_m)

    def circumscribed_m(self) -> float:
        """Radius of the smallest circle around base_link that holds the footprint."""
        return math.hypot(max(self.front_m, -self.rear_m), 0.5 * self.width_m)


class Chassis(Config):
    """The box that carries everything but wheels and steering modules, centred over base_link, m above the ground."""

    length_m: Positive
    width_m: Positive
    bottom_m: Positive
    top_m: Positive

    @model_validator(mode="after")
    def _top_above_bottom(self) -> Chassis:
        if self.top_m <= self.bottom_m:
            raise ValueError("top_m must be above bottom_m")
        return self


class Motor(Config):
    """One kind of servo axis: motor, gear and encoder. Torques and speeds at the wheel or steering axis.

    gear_numerator turns of the motor are gear_denominator turns of the wheel or steering axis.
    encoder_counts_per_rev: of the motor. absolute_encoder: the angle is known at power-on. rated_torque_nm: the engine
    reports percent of it. position_width_rad: within it the engine reports that a position is reached.
    """

    encoder_counts_per_rev: Annotated[int, Field(gt=0, le=_LARGEST_GEAR)]
    gear_numerator: Positive
    gear_denominator: Positive
    absolute_encoder: bool
    rated_torque_nm: Positive
    max_torque_nm: Positive
    torque_lag_s: Positive
    position_width_rad: Positive

    @property
    def counts_per_turn(self) -> float:
        """Encoder counts of one turn of the wheel or steering axis."""
        return self.encoder_counts_per_rev * self.gear_numerator / self.gear_denominator

    @model_validator(mode="after")
    def _counts_in_range(self) -> Self:
        counts = self.counts_per_turn
        if not 1.0 <= counts <= _LARGEST_GEAR:
            raise ValueError(
                "encoder_counts_per_rev * gear_numerator / gear_denominator must be within "
                f"1..{_LARGEST_GEAR}, the engine's gear ratios, is {counts:.6g}"
            )
        return self


class Drive(Motor):
    """One drive motor with its gear and wheel.

    stall_speed_radps: a difference of command and wheel that lasts for stall_time_s stops the axis with an alarm.
    """

    max_speed_radps: Positive
    brake_torque_nm: Positive
    quick_stop_deceleration_mps2: Positive
    stall_speed_radps: Positive
    stall_time_s: Positive


class SteeringHoming(Config):
    """How a steering axis without an absolute encoder finds its zero.

    current_position: the present heading becomes straight ahead. home_switch: the engine turns the axis in
    ``direction`` to the drive's home switch.
    """

    type: Literal["current_position", "home_switch"]
    direction: Literal["positive", "negative"]
    fast_radps: Positive
    slow_radps: Positive
    acceleration_radps2: Positive


class Steer(Motor):
    """One steering motor with its gear; the axis turns without end.

    following_error_rad: a larger difference of command and axis stops the axis with an alarm.
    """

    max_rate_radps: Positive
    max_acceleration_radps2: Positive
    emergency_deceleration_radps2: Positive
    quick_stop_deceleration_radps2: Positive
    following_error_rad: Positive
    homing: SteeringHoming


class JointAxis(Config):
    """A joint's axis of the motion engine. number: the engine's. polarity: -1 if the motor turns the other way.

    zero_rad: reading of an absolute encoder at zero, at the joint and after the polarity.
    """

    number: Annotated[int, Field(ge=0, lt=128)]
    polarity: Literal[1, -1]
    zero_rad: float = 0.0


class Latch(Config):
    """The wheelchair's latch: where it holds a wheelchair's rail ends, base_link, and its engine I/O.

    Rail ends are held at x_m, half_width_m to either side, height_m above the ground. Bits are those of one output byte
    and of the input byte of the same number.
    """

    x_m: Positive
    half_width_m: Positive
    height_m: Positive
    byte: Annotated[int, Field(ge=0, lt=8000)]
    close_output_bit: Bit
    open_output_bit: Bit
    closed_input_bit: Bit
    open_input_bit: Bit

    @model_validator(mode="after")
    def _bits_differ(self) -> Latch:
        if self.close_output_bit == self.open_output_bit:
            raise ValueError("the output bits must differ")
        return self


class SafetyEdge(Config):
    """The safety edge: strips of foam on the four sides of the deck and on the latch's plates, and their engine inputs.

    Each strip has a switch. All of them are in series in a relay, whose contact stops the engine without any client.
    Inputs are bits of one input byte, normally closed: 1 = free, 0 = pressed or wire cut. The strips' outer faces lie
    on ``Robot.footprint``. trigger_m: deformation at which a switch opens. travel_m: deformation at which the foam is
    compressed. stiffness_n_per_m: of one strip.
    """

    byte: Annotated[int, Field(ge=0, lt=8000)]
    front_input_bit: Bit
    rear_input_bit: Bit
    left_input_bit: Bit
    right_input_bit: Bit
    relay_input_bit: Bit
    trigger_m: Positive
    travel_m: Positive
    stiffness_n_per_m: Positive

    @property
    def side_bits(self) -> dict[str, int]:
        """Input bit of each side, in the order of ``SIDES``."""
        bits = (self.front_input_bit, self.rear_input_bit, self.left_input_bit, self.right_input_bit)
        return dict(zip(SIDES, bits, strict=True))

    def stopping_way_m(self, deceleration_mps2: float) -> float:
        """Way of a robot at creep speed from the first touch until it stands, m."""
        ramp_m = CREEP_SPEED_MPS**2 / (2.0 * deceleration_mps2)
        return self.trigger_m + CREEP_SPEED_MPS * EDGE_REACTION_S + ramp_m


class Mast(Config):
    """The upright tube that carries the overhead LiDAR's boom, m, base_link."""

    x_m: float
    y_m: float
    radius_m: Positive
    bottom_m: Positive
    top_m: Positive

    @model_validator(mode="after")
    def _stands(self) -> Mast:
        if self.top_m <= self.bottom_m:
            raise ValueError("top_m must be above bottom_m")
        return self


class Robot(Config):
    """Physical parameters of the machine, independent of the drive software."""

    modules: dict[str, ModulePosition]
    wheel_radius_m: Positive
    wheel_width_m: Positive
    mass_kg: Positive
    chair_mass_kg: Positive
    passenger_max_mass_kg: Positive
    wheel_mass_kg: Positive
    steer_mass_kg: Positive
    centre_of_gravity_height_m: Positive
    footprint: Footprint
    footprint_with_chair: Footprint
    chassis: Chassis
    empty: Motion
    with_passenger: Motion
    emergency_deceleration_mps2: Positive
    drive: Drive
    steer: Steer
    axes: dict[str, JointAxis]
    imu_xyz_m: Xyz
    front_camera_xyz_m: Xyz
    front_camera_rpy_deg: Rpy
    rear_camera_xyz_m: Xyz
    rear_camera_rpy_deg: Rpy
    range_sensors: dict[str, RangeSensor]
    mast: Mast
    estop_input_byte: Annotated[int, Field(ge=0, lt=8000)]
    estop_input_bit: Bit
    latch: Latch
    safety_edge: SafetyEdge | None = None

    @model_validator(mode="after")
    def _stands_on_its_modules(self) -> Robot:
        if tuple(self.modules) != frames.MODULES:
            raise ValueError(f"modules must be {', '.join(frames.MODULES)}, in this order")
        fl, fr, rl, rr = self.module_positions_m()
        around = (fl, rl, rr, fr)
        for index, (x, y) in enumerate(around):
            (next_x, next_y), (after_x, after_y) = around[(index + 1) % 4], around[(index + 2) % 4]
            if x * next_y - next_x * y <= 0.0:
                raise ValueError("base_link must lie between the modules, fl ahead on the left, rr behind on the right")
            if (next_x - x) * (after_y - next_y) - (next_y - y) * (after_x - next_x) <= 0.0:
                raise ValueError("no module may lie between the three others")
        return self

    @model_validator(mode="after")
    def _every_joint_has_an_axis(self) -> Robot:
        missing, unknown = set(frames.JOINTS) - set(self.axes), set(self.axes) - set(frames.JOINTS)
        if missing or unknown:
            wrong = [f"{name} is missing" for name in sorted(missing)] + [f"{name} is no joint" for name in unknown]
            raise ValueError(f"axes must have the joints {', '.join(frames.JOINTS)}; {', '.join(wrong)}")
        taken: dict[int, str] = {}
        for name, axis in self.axes.items():
            if axis.zero_rad and not self.motor(name).absolute_encoder:
                raise ValueError(f"axes.{name}.zero_rad must be 0 without an absolute encoder, is {axis.zero_rad}")
            first = taken.setdefault(axis.number, name)
            if first != name:
                raise ValueError(f"axes.{name}.number {axis.number} is {first}'s too; each joint needs its own axis")
        return self

    @model_validator(mode="after")
    def _has_its_lidar(self) -> Robot:
        lidar = self.range_sensors.get(frames.LIDAR)
        if lidar is None:
            raise ValueError(f"range_sensors.{frames.LIDAR} is missing")
        return self

    @model_validator(mode="after")
    def _footprint_holds_the_robot(self) -> Robot:
        """A robot that extends beyond its planning footprint would collide where the plan shows clearance."""
        front, rear, half = self.footprint.front_m, self.footprint.rear_m, 0.5 * self.footprint.width_m
        radius, places = self.wheel_radius_m, self.module_positions_m()
        ahead = max(*(x + radius for x, _ in places), 0.5 * self.chassis.length_m)
        behind = max(*(radius - x for x, _ in places), 0.5 * self.chassis.length_m)
        across = max(*(abs(y) + radius for _, y in places), 0.5 * self.chassis.width_m)
        if ahead > front or behind > -rear or across > half:
            raise ValueError("footprint must hold the chassis and the wheels, however they are steered")
        chair = self.footprint_with_chair
        if chair.front_m < front or chair.rear_m > rear or 0.5 * chair.width_m < half:
            raise ValueError("footprint_with_chair must hold footprint")
        return self

    @property
    def lidar_xyz_m(self) -> tuple[float, float, float]:
        """The spinning LiDAR in base_link, m; its frame has base_link's axes, see ``sensor_frame``."""
        return self.range_sensors[frames.LIDAR].xyz_m

    def edge_boxes(self) -> tuple[tuple[float, float, float], ...]:
        """Front, rear and half width, m, base_link, of two crossed boxes whose faces are the safety edge's strips.

        The first has the front and the rear strip, the second left and right; both have the chassis' height. The rails
        of a latched wheelchair end at the footprint's front, beside the front strip and ahead of the second box. Empty
        without an edge.
        """
        edge, chassis, footprint = self.safety_edge, self.chassis, self.footprint
        if edge is None:
            return ()
        along_half_m = min(0.5 * chassis.width_m, self.latch.half_width_m - _RAIL_CLEARANCE_M)
        across_front_m = 0.5 * chassis.length_m - edge.travel_m
        return (
            (footprint.front_m, footprint.rear_m, along_half_m),
            (across_front_m, -across_front_m, 0.5 * footprint.width_m),
        )

    def sensor_frame(self, name: str) -> NDArray[np.float64]:
        """(3, 3) from the frame in which a range sensor's points are published to base_link.

        The spinning LiDAR's frame has base_link's axes: the publisher of its sweeps rotates them by its mounting first
        (``to_sensor_frame``), so that subscribers need not know the mounting.
        """
        return np.eye(3) if name == frames.LIDAR else self.range_sensors[name].rotation()

    def to_sensor_frame(self, name: str) -> NDArray[np.float64]:
        """(3, 3) from a range sensor's own axes to those of the frame in which its points are published."""
        return self.range_sensors[name].rotation() if name == frames.LIDAR else np.eye(3)

    @model_validator(mode="after")
    def _inputs_differ(self) -> Robot:
        latch, edge = self.latch, self.safety_edge
        inputs = [
            ("estop_input_bit", self.estop_input_byte, self.estop_input_bit),
            ("latch.closed_input_bit", latch.byte, latch.closed_input_bit),
            ("latch.open_input_bit", latch.byte, latch.open_input_bit),
        ]
        if edge is not None:
            bits = {**edge.side_bits, "relay": edge.relay_input_bit}
            inputs += [(f"safety_edge.{name}_input_bit", edge.byte, bit) for name, bit in bits.items()]
        taken: dict[tuple[int, int], str] = {}
        for name, byte, bit in inputs:
            first = taken.setdefault((byte, bit), name)
            if first != name:
                raise ValueError(f"{name} {bit} of byte {byte} is {first} too; each input needs a bit of its own")
        return self

    @model_validator(mode="after")
    def _edge_stops_in_time(self) -> Robot:
        """An edge that is compressed before the robot stands hits with the robot's whole mass."""
        edge = self.safety_edge
        if edge is None:
            return self
        way_m = edge.stopping_way_m(self.emergency_deceleration_mps2)
        if not edge.travel_m > way_m:
            raise ValueError(
                f"safety_edge.travel_m must exceed the stopping way from {CREEP_SPEED_MPS} m/s with "
                f"{EDGE_REACTION_S} s of reaction and trigger_m, {way_m:.4f} m, is {edge.travel_m} m"
            )
        footprint, chassis = self.footprint, self.chassis
        if not edge.travel_m < min(0.5 * chassis.length_m, footprint.front_m, -footprint.rear_m, 0.5 * chassis.width_m):
            raise ValueError(
                f"safety_edge.travel_m ({edge.travel_m} m) must be less than half of chassis and footprint"
            )
        return self

    @model_validator(mode="after")
    def _passenger_is_slower(self) -> Robot:
        for name in Motion.model_fields:
            if getattr(self.with_passenger, name) > getattr(self.empty, name):
                raise ValueError(f"with_passenger.{name} must not exceed empty.{name}")
        return self

    def module_positions_m(self) -> tuple[tuple[float, float], ...]:
        """(x, y) of the steering axes in base_link, m, in module order FL FR RL RR."""
        return tuple((self.modules[name].x_m, self.modules[name].y_m) for name in frames.MODULES)

    def motor(self, joint: str) -> Drive | Steer:
        """The kind of servo axis of a joint."""
        return self.drive if joint.endswith("_drive") else self.steer

    @property
    def joint_axes(self) -> tuple[int, ...]:
        """The engine's axis of each joint, in the order of ``frames.JOINTS``."""
        return tuple(self.axes[name].number for name in frames.JOINTS)

    def motion(self, passenger_attached: bool) -> Motion:
        return self.with_passenger if passenger_attached else self.empty


def load_robot() -> Robot:
    """``config/robot.yaml``. Raises ConfigError."""
    return load(Robot, "robot")
