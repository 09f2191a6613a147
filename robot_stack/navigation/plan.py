"""A plan from a state of motion to rest at a goal pose, within the limits at every moment.

A swerve robot moves and turns independently: the translation runs straight to the goal while the yaw turns beside it,
evenly over the same time. From another course the velocity first changes along a straight line in velocity
space, which keeps speed and acceleration inside their circles, to the course from which the goal lies straight ahead:
successive goals are joined by a rounded corner, without a stop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from robot_stack.core.geometry import Pose2, wrap_angle
from robot_stack.core.limits import MotionLimits
from robot_stack.navigation.limits import PlanningLimits
from robot_stack.navigation.motion import MotionState, Segment, Trajectory, Vector
from robot_stack.navigation.speed_profile import AxisLimits, Profile, to_position, to_speed

# Sideways components of velocity and acceleration below these are rounding.
_SIDE_SPEED_MPS, _SIDE_ACCELERATION_MPS2 = 1e-3, 1e-2
_NEAR_M = 1e-6
_UNBOUNDED_MPS = 1e3
# Shares of the limit speed tried for entering a new course; 0 is a stop, which always works.
_ENTRY_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
_ITERATIONS = 30
_STRETCHES = 6
_SAMPLES = 40


def plan_motion(start: MotionState, goal: Pose2, limits: PlanningLimits) -> Trajectory:
    """The motion from ``start`` to rest at ``goal``; a motion that turns too fast for its speed is stretched in time.

    Raises ValueError for a start or goal that is not finite.
    """
    if not (start.is_finite() and goal.is_finite()):
        raise ValueError(f"start and goal must be finite: {start}, {goal}")
    trajectory = _plan(start, goal, limits, 0.0)
    for _ in range(_STRETCHES):
        turning = _turning_mps2(trajectory)
        if turning <= limits.max_turning_mps2:
            break
        # Speed and yaw rate both scale with 1 / duration; a little more because of the ramps.
        stretch = 1.05 * math.sqrt(turning / limits.max_turning_mps2)
        trajectory = _plan(start, goal, limits, stretch * trajectory.duration_s)
    return trajectory


def plan_stop(start: MotionState, limits: MotionLimits) -> Trajectory:
    """The motion from ``start`` to rest along its own course, wherever that ends."""
    segments = _velocity_change(start, (0.0, 0.0), limits)
    yaw = to_speed(0.0, start.yaw_rate, start.yaw_acceleration, _yaw_axis(limits))
    return Trajectory(tuple(segments), start.pose.yaw, yaw)


def _plan(start: MotionState, goal: Pose2, limits: PlanningLimits, min_duration_s: float) -> Trajectory:
    segments = _translation(start, goal, limits, min_duration_s)
    yaw = _turn(start, goal.yaw, limits.cruise, max(min_duration_s, _duration_s(segments)))
    if yaw.duration_s > _duration_s(segments) + 1e-6:
        segments = _translation(start, goal, limits, yaw.duration_s)
    return Trajectory(tuple(segments), start.pose.yaw, yaw)


def _duration_s(segments: list[Segment]) -> float:
    return sum(segment.duration_s for segment in segments)


def _turning_mps2(trajectory: Trajectory) -> float:
    """The largest product of speed and yaw rate on the way, m/s2; 0 if it does not exceed that of the start."""
    start = trajectory.at(0.0)
    brought = start.speed() * abs(start.yaw_rate)
    states = (trajectory.at(trajectory.duration_s * i / _SAMPLES) for i in range(1, _SAMPLES))
    worst = max(state.speed() * abs(state.yaw_rate) for state in states)
    return worst if worst > brought + 1e-9 else 0.0


def _turn(start: MotionState, goal_yaw: float, limits: MotionLimits, min_duration_s: float) -> Profile:
    """The shorter turn; for a body that already turns, the faster one."""
    angle = wrap_angle(goal_yaw - start.pose.yaw)
    other = angle - math.copysign(2.0 * math.pi, angle)
    angles = (angle, other) if abs(start.yaw_rate) > 0.0 else (angle,)
    axis = _yaw_axis(limits)
    profiles = [(to_position(a, start.yaw_rate, start.yaw_acceleration, axis), a) for a in angles]
    _, best = min(profiles, key=lambda item: item[0].duration_s)
    return to_position(best, start.yaw_rate, start.yaw_acceleration, axis, min_duration_s)


def _translation(start: MotionState, goal: Pose2, limits: PlanningLimits, min_duration_s: float) -> list[Segment]:
    position = (start.pose.x, start.pose.y)
    course = _course(position, (goal.x, goal.y), start.velocity)
    if (
        abs(_cross(course, start.velocity)) < _SIDE_SPEED_MPS
        and abs(_cross(course, start.acceleration)) < _SIDE_ACCELERATION_MPS2
    ):
        speed, acceleration = _dot(course, start.velocity), _dot(course, start.acceleration)
        # Where the speed ends if the acceleration fades now. Above the limit a profile to the goal would brake as hard
        # as it can to the limit and swing below it; a change of speed before it does not.
        faded = abs(speed + 0.5 * acceleration * abs(acceleration) / limits.cruise.jerk_mps3)
        if faded <= limits.cruise.speed_mps + _SIDE_SPEED_MPS:
            return [_line(position, (goal.x, goal.y), course, speed, acceleration, limits.cruise, min_duration_s)]
    too_fast = start.speed() > limits.cruise.speed_mps + _SIDE_SPEED_MPS
    change = limits.braking if too_fast else limits.cruise
    return min(_entries(start, goal, limits.cruise, change, min_duration_s), key=_duration_s)


def _entries(
    start: MotionState, goal: Pose2, limits: MotionLimits, change_limits: MotionLimits, min_duration_s: float
) -> Iterator[list[Segment]]:
    """Ways onto the course to the goal, one per entry speed that reaches the course without overshoot."""
    for share in _ENTRY_SHARES:
        speed = share * limits.speed_mps
        change = _onto_course(start, goal, speed, change_limits)
        if change is None:
            continue
        (position, _, _) = change[-1].end() if change else ((start.pose.x, start.pose.y), start.velocity, (0.0, 0.0))
        course = _course(position, (goal.x, goal.y), start.velocity)
        elapsed_s = _duration_s(change)
        line = _line(position, (goal.x, goal.y), course, speed, 0.0, limits, min_duration_s - elapsed_s)
        lowest, highest = line.profile.extent()
        distance_m = math.dist(position, (goal.x, goal.y))
        if share == 0.0 or (highest < distance_m + _SIDE_SPEED_MPS and lowest > -_SIDE_SPEED_MPS):
            yield [*change, line]


def _onto_course(start: MotionState, goal: Pose2, speed: float, limits: MotionLimits) -> list[Segment] | None:
    """The change to ``speed`` on a course that points to the goal at its end; None if none is found."""
    course = _course((start.pose.x, start.pose.y), (goal.x, goal.y), start.velocity)
    for _ in range(_ITERATIONS):
        change = _velocity_change(start, (speed * course[0], speed * course[1]), limits)
        end = change[-1].end()[0] if change else (start.pose.x, start.pose.y)
        ahead = _course(end, (goal.x, goal.y), course)
        if math.dist(ahead, course) < 1e-7:
            return change
        course = ahead
        if speed == 0.0:
            return change
    return None


def _velocity_change(start: MotionState, velocity: Vector, limits: MotionLimits) -> list[Segment]:
    """To a steady ``velocity``: first the acceleration fades along itself, then velocity goes straight to its target.

    One straight change suffices where the acceleration already points along it.
    """
    # The bound on speed is kept by the geometry: both ends lie inside the circle, and so does the line between them.
    axis = AxisLimits(_UNBOUNDED_MPS, limits.acceleration_mps2, limits.jerk_mps3)
    position, now = (start.pose.x, start.pose.y), start.velocity
    segments: list[Segment] = []
    direction, size = _unit((velocity[0] - now[0], velocity[1] - now[1]))
    if abs(_cross(direction, start.acceleration)) > _SIDE_ACCELERATION_MPS2 or size == 0.0:
        along, acceleration = _unit(start.acceleration)
        if acceleration > 0.0:
            fading = to_speed(0.5 * acceleration**2 / limits.jerk_mps3, 0.0, acceleration, axis)
            segments.append(Segment(position, now, along, fading))
            position, now, _ = segments[-1].end()
        direction, size = _unit((velocity[0] - now[0], velocity[1] - now[1]))
        acceleration = 0.0
    else:
        acceleration = _dot(direction, start.acceleration)
    if size > 0.0:
        segments.append(Segment(position, now, direction, to_speed(size, 0.0, acceleration, axis)))
    return segments or [Segment(position, now, direction, to_speed(0.0, 0.0, 0.0, axis))]


def _line(
    start: Vector, goal: Vector, course: Vector, speed: float, acceleration: float, limits: MotionLimits, min_s: float
) -> Segment:
    axis = AxisLimits(limits.speed_mps, limits.acceleration_mps2, limits.jerk_mps3)
    distance = _dot(course, (goal[0] - start[0], goal[1] - start[1]))
    return Segment(start, (0.0, 0.0), course, to_position(distance, speed, acceleration, axis, min_s))


def _yaw_axis(limits: MotionLimits) -> AxisLimits:
    return AxisLimits(limits.yaw_rate_radps, limits.yaw_acceleration_radps2, limits.yaw_jerk_radps3)


def _course(start: Vector, goal: Vector, otherwise: Vector) -> Vector:
    """Unit vector from ``start`` to ``goal``; along ``otherwise`` where they are one point."""
    direction, distance = _unit((goal[0] - start[0], goal[1] - start[1]))
    return direction if distance > _NEAR_M else _unit(otherwise)[0]


def _unit(vector: Vector) -> tuple[Vector, float]:
    """(unit vector, length); (1, 0) for the null vector."""
    length = math.hypot(*vector)
    return ((vector[0] / length, vector[1] / length), length) if length > 0.0 else ((1.0, 0.0), 0.0)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1]


def _cross(a: Vector, b: Vector) -> float:
    return a[0] * b[1] - a[1] * b[0]
