"""Conversions between the messages of FollowJointTrajectory and the values of its kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectoryPoint

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance as JointToleranceMsg
from robot_stack.middleware.conversions import duration_from_s, time_to_s
from robot_stack.wmx.trajectory.execution import Sample
from robot_stack.wmx.trajectory.goal import Goal, Point
from robot_stack.wmx.trajectory.results import Result
from robot_stack.wmx.trajectory.tolerances import JointTolerance

FloatArray = NDArray[np.float64]


def goal_from_msg(message: FollowJointTrajectory.Goal) -> Goal:
    trajectory = message.trajectory
    return Goal(
        joint_names=list(trajectory.joint_names),
        points=[
            Point(point.positions, _seconds(point.time_from_start), point.velocities, point.accelerations, point.effort)
            for point in trajectory.points
        ],
        stamp_s=time_to_s(trajectory.header.stamp),
        path_tolerance=_tolerances(message.path_tolerance),
        goal_tolerance=_tolerances(message.goal_tolerance),
        goal_time_s=_seconds(message.goal_time_tolerance),
        multi_dof_joints=list(message.multi_dof_trajectory.joint_names),
    )


def result_to_msg(result: Result) -> FollowJointTrajectory.Result:
    return FollowJointTrajectory.Result(error_code=result.code, error_string=result.text)


def feedback_to_msg(sample: Sample, joints: tuple[str, ...], order: tuple[int, ...], stamp: Time) -> Any:
    """The joints in the goal's order."""
    columns = list(order)
    time_from_start = duration_from_s(max(0.0, sample.time_s))

    def point(
        position: FloatArray, velocity: FloatArray, acceleration: FloatArray | None = None
    ) -> JointTrajectoryPoint:
        message = JointTrajectoryPoint(time_from_start=time_from_start)
        message.positions = position[columns].tolist()
        message.velocities = velocity[columns].tolist()
        if acceleration is not None:
            message.accelerations = acceleration[columns].tolist()
        return message

    feedback = FollowJointTrajectory.Feedback(joint_names=[joints[column] for column in columns])
    feedback.header.stamp = stamp
    feedback.desired = point(sample.position, sample.velocity, sample.acceleration)
    feedback.actual = point(sample.actual_position, sample.actual_velocity)
    feedback.error = point(sample.position - sample.actual_position, sample.velocity - sample.actual_velocity)
    return feedback


def _tolerances(messages: list[JointToleranceMsg]) -> list[JointTolerance]:
    return [JointTolerance(item.name, item.position, item.velocity, item.acceleration) for item in messages]


def _seconds(duration: Duration) -> float:
    return duration.sec + 1e-9 * duration.nanosec
