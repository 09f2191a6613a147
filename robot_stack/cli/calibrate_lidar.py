"""``robot-stack calibrate lidar``: reads a ride, estimates the mounting, draws it, prints the values for the files."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from robot_stack.cli.errors import CommandError, writing
from robot_stack.cli.map_build import ProgressBar
from robot_stack.cli.map_recording import read_ride
from robot_stack.contract import frames
from robot_stack.core.config import load
from robot_stack.core.robot import load_robot
from robot_stack.mapping.mount import MountFound, mount_of
from robot_stack.mapping.params import MappingParams
from robot_stack.mapping.ride import RideError

Angles = tuple[float, float, float]
_DPI = 110


def calibrate_lidar(recording: Path, rpy_deg: Angles | None, picture: Path | None) -> None:
    """rpy_deg: the LiDAR's mounting during the recording, None: the present one.

    Raises CommandError, ConfigError.
    """
    params, robot = load(MappingParams, "mapping"), load_robot()
    with ProgressBar() as bar:
        ride, warnings = read_ride(recording, params.sweeps, robot, lambda done, total: bar("reading", done, total))
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    try:
        found = mount_of(ride, params, robot)
    except RideError as error:
        raise CommandError(f"{recording}: {error}") from None
    before_deg = rpy_deg or robot.range_sensors[frames.LIDAR].rpy_deg
    print("\n".join(lines_of(found, before_deg, robot.lidar_xyz_m)))
    if picture is not None:
        draw_mount(found, picture)
        print(f"picture: {picture}")


def lines_of(found: MountFound, before_deg: Angles, sensor_m: tuple[float, float, float]) -> list[str]:
    """The result in words."""
    tilt, heading = found.tilt, found.heading
    one, turn = np.degrees(tilt.deviation_rad), np.degrees(heading.deviation_rad)
    roll, pitch, yaw = found.rpy_deg((0.0, 0.0, 0.0))
    x, y, z = sensor_m
    rpy = ", ".join(f"{angle:.2f}" for angle in found.rpy_deg(before_deg))
    ends = np.percentile(found.yaw_rad, [0.0, 100.0])
    return [
        f"{found.sweeps} sweeps, {heading.distance_m:.1f} m, headings of {np.degrees(ends[1] - ends[0]):.0f} deg",
        f"rotate the cloud by roll {roll:.2f}, pitch {pitch:.2f} (+- {one:.3f}), yaw {yaw:.2f} (+- {turn:.3f}) deg",
        f"the sensor is {tilt.height_m:.3f} m above the ground (+- {tilt.height_deviation_m:.4f}), not {z:.3f}",
        f"residuals: ground {1e3 * tilt.ground_rms_m:.0f} mm rms, steps {1e3 * _rms(heading.residuals_m[:, 0]):.0f} mm "
        f"along and {1e3 * _rms(heading.residuals_m[:, 1]):.0f} mm across the path",
        f"compared with wheel odometry, the LiDAR's path is {100.0 * (heading.scale - 1.0):+.2f} % longer and turns by "
        f"{np.degrees(heading.turn_radpm):+.2f} deg/m more",
        "write into config/robot.yaml, range_sensors, lidar, then record another ride: corrections must be near zero:",
        f"  xyz_m: [{x:g}, {y:g}, {tilt.height_m:.3f}]",
        f"  rpy_deg: [{rpy}]",
    ]


def draw_mount(found: MountFound, file: Path) -> None:
    """Left: each sweep's tilt against the ground, by heading, with the fit of mounting and slope; right: the steps.

    Raises CommandError.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    order = np.argsort(found.yaw_rad)
    heading = np.degrees(found.yaw_rad[order])
    for column, (name, colour) in enumerate((("roll", "tab:blue"), ("pitch", "tab:orange"))):
        left.plot(heading, np.degrees(found.tilt.vectors[order, column]), ".", color=colour, alpha=0.5, label=name)
        left.plot(heading, np.degrees(found.tilt.fitted[order, column]), color=colour)
    left.set(xlabel="heading in odom, deg", ylabel="levels the ground, deg", title="tilt: sweeps, mount and slope")
    left.legend()
    residuals = 1e3 * found.heading.residuals_m
    right.plot(residuals[:, 0], residuals[:, 1], ".", alpha=0.6)
    right.axhline(0.0, color="0.7")
    right.axvline(0.0, color="0.7")
    right.set(xlabel="along the path, mm", ylabel="across, mm", title="steps of LiDAR and wheels: residuals")
    with writing(file):
        figure.savefig(file, dpi=_DPI)


def _rms(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.mean(values**2)))
