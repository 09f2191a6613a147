"""``robot-stack calibrate wheels``: runs a ride's joint states through the self-calibrating odometry."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from robot_stack.cli.errors import CommandError, writing
from robot_stack.cli.map_recording import messages
from robot_stack.contract import topics
from robot_stack.contract.frames import MODULES
from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.drive.joint_states import BadJointStates, encoders
from robot_stack.drive.odometry import SwerveOdometry
from robot_stack.drive.params import CalibrationParams, SwerveControllerParams
from robot_stack.drive.self_calibration import Learnt

# An estimate is unobserved if its deviation is hardly below the prior's.
_TOLD = 0.3


def calibrate_wheels(recording: Path, picture: Path | None) -> None:
    """Raises CommandError, ConfigError."""
    params, robot = load(SwerveControllerParams, "swerve_controller"), load_robot()
    odometry = SwerveOdometry(params.odometry, robot)
    refused = 0
    for item in messages(recording, (topics.JOINT_STATES.name,), lambda done, total: None):
        if isinstance(item, str):
            print(f"warning: {item}", file=sys.stderr)
            continue
        message = item.decode()
        try:
            stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            odometry.update(encoders(stamp_s, message.name, message.position))
        except BadJointStates:
            refused += 1
    if refused:
        print(f"warning: {recording}: {refused} joint states refused", file=sys.stderr)
    learnt = odometry.calibration.learnt()
    problem = untold(learnt, params.odometry.calibration)
    if problem:
        raise CommandError(f"{recording}: {problem}")
    print("\n".join(lines_of(learnt)))
    if picture is not None:
        draw_wheels(learnt, picture)
        print(f"picture: {picture}")


def untold(learnt: Learnt, prior: CalibrationParams) -> str:
    """The reason if the ride does not determine the wheels' errors; empty if it does."""
    if not learnt.readings:
        return f"there is no motion in {topics.JOINT_STATES.name}"
    if max(learnt.radius_deviations) > _TOLD * prior.radius_deviation:
        return "the ride does not determine the wheel radii: drive straight for longer"
    if max(learnt.zero_deviations_rad) > _TOLD * prior.zero_deviation_rad:
        return "the ride does not determine the steering zeros: drive straight and sideways for longer"
    return ""


def lines_of(learnt: Learnt) -> list[str]:
    """The result in words."""
    rows = zip(
        MODULES,
        learnt.radius_errors,
        learnt.radius_deviations,
        learnt.zero_errors_rad,
        learnt.zero_deviations_rad,
        strict=True,
    )
    return [
        f"{learnt.readings} readings in motion; residual of a rigid motion per wheel: "
        f"{1e6 * learnt.unlike_m:.0f} um per reading, {1e6 * learnt.left_m:.0f} um with the correction",
        "module   error of the wheel radius  offset of the steering encoder",
        *(
            f"{name:<6}{100 * radius:+9.3f} % +- {100 * radius_sigma:.3f} {math.degrees(zero):+16.3f} deg "
            f"+- {math.degrees(zero_sigma):.3f}"
            for name, radius, radius_sigma, zero, zero_sigma in rows
        ),
        "Differences between the wheels; an error common to all wheels is not observable.",
        "The swerve controller estimates the same values while driving. Adjust zeros beyond 0.1 deg at the module.",
    ]


def draw_wheels(learnt: Learnt, file: Path) -> None:
    """Draws bars with three standard deviations. Raises CommandError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    percent = [100.0 * value for value in learnt.radius_errors], [300.0 * value for value in learnt.radius_deviations]
    degrees = (
        [math.degrees(value) for value in learnt.zero_errors_rad],
        [3.0 * math.degrees(value) for value in learnt.zero_deviations_rad],
    )
    for axes, (values, bars), what in (
        (left, percent, "wheel radius error, %"),
        (right, degrees, "encoder offset, deg"),
    ):
        axes.bar(list(MODULES), values, yerr=bars, color="tab:blue", alpha=0.7, capsize=4)
        axes.axhline(0.0, color="0.5")
        axes.set(ylabel=what)
    left.set(title="wheel radii")
    right.set(title="steering zeros")
    with writing(file):
        figure.savefig(file, dpi=110)
