"""``robot-stack calibrate extrinsics``: compares the robot's motion measured by a camera and by the LiDAR."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_stack.cli.errors import WRONG_USE, CommandError, writing
from robot_stack.cli.map_build import ProgressBar
from robot_stack.cli.map_recording import messages, read_ride
from robot_stack.contract import frames, topics
from robot_stack.core.camera import camera_file, load_intrinsics, mounting, turned_by_deg
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.core.robot import load_robot
from robot_stack.docking.vision.detector import MarkerDetector, MarkerObservation
from robot_stack.docking.vision.params import ArucoDetectorParams
from robot_stack.mapping.camera_mount import CameraMountFound, camera_mount_of
from robot_stack.mapping.lidar_odometry import lidar_odometry
from robot_stack.mapping.params import CameraMount, MappingParams
from robot_stack.mapping.poses import Floats, inverse, planar
from robot_stack.mapping.refinement import map_of, onto_map, thinned
from robot_stack.mapping.ride import Ride, RideError

IMAGES = {frames.FRONT_CAMERA: topics.FRONT_IMAGE.name, frames.REAR_CAMERA: topics.REAR_IMAGE.name}
_DPI = 110


@dataclass(frozen=True, slots=True)
class Views:
    """stamp_s: (n,), poses: (n, 4, 4) of the dock's board in the camera."""

    dock: str
    stamp_s: Floats
    poses: Floats
    images: int


def calibrate_extrinsics(recording: Path, frame: str, picture: Path | None) -> None:
    """Raises CommandError, ConfigError."""
    if frame not in IMAGES:
        raise CommandError(f"no camera {frame!r}; there are {', '.join(IMAGES)}", WRONG_USE)
    params, robot = load(MappingParams, "mapping"), load_robot()
    every = params.sweeps.model_copy(update={"step_m": 0.0, "step_rad": 0.0})  # includes sweeps at standstill
    with ProgressBar() as bar:
        ride, warnings = read_ride(recording, every, robot, lambda done, total: bar("sweeps", done, total))
        views = read_views(recording, frame, lambda done, total: bar("images", done, total))
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    nominal = mounting(robot, frame)
    try:
        base, seen = beside(ride, views, params)
        found = camera_mount_of(base, seen, nominal, params.camera_mount)
    except RideError as error:
        raise CommandError(f"{recording}: {error}") from None
    print("\n".join(lines_of(found, frame, nominal, views)))
    if picture is not None:
        draw(found, picture)
        print(f"picture: {picture}")


def read_views(recording: Path, frame: str, progress: Callable[[int, int], None]) -> Views:
    """The views of the dock in the most images. Raises CommandError if there is none."""
    docks, intrinsics = load_docks(), load_intrinsics(camera_file(frame))
    detector = MarkerDetector(docks, load(ArucoDetectorParams, "aruco_detector").detector)
    found: list[tuple[str, float, Floats]] = []
    images = 0
    for item in messages(recording, (IMAGES[frame],), progress):
        if isinstance(item, str):
            continue  # reported with the sweeps, from the same files
        message = item.decode()
        images += 1
        stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        try:
            observed = detector.detect(_grey(message), intrinsics, frame, stamp_s)
        except ValueError as error:
            raise CommandError(f"{recording}: {item.topic}: {error}") from None
        boards = {name: pose for marker in observed for name, pose in _boards(marker, docks.docks)}
        found += [(name, stamp_s, pose) for name, pose in boards.items()]
    if not images:
        raise CommandError(f"{recording}: no message on {IMAGES[frame]}: record with the recorder's images: always")
    if not found:
        raise CommandError(f"{recording}: none of {images} images of {frame} shows the markers of a dock")
    dock = Counter(name for name, _, _ in found).most_common(1)[0][0]
    rows = [(stamp_s, pose) for name, stamp_s, pose in found if name == dock]
    return Views(dock, np.array([stamp for stamp, _ in rows]), np.array([pose for _, pose in rows]), images)


def beside(ride: Ride, views: Views, params: MappingParams) -> tuple[Floats, Floats]:
    """(base_link by the LiDAR (n, 4, 4), the board in the camera (n, 4, 4)), one pair for each place of standstill.

    Raises RideError.
    """
    pairs = places(ride, views, params.camera_mount)
    if not pairs:
        raise RideError(
            "no standstill with the markers in view: stop for 1 s to 2 s at each place, so that camera and LiDAR do "
            "not move during a measurement"
        )
    sweep, view = np.array(pairs, np.intp).T
    stamps = np.array([ride.sweeps[index].stamp_s for index in sweep])
    points = [np.asarray(ride.sweeps[index].points, np.float64) for index in sweep]
    poses, matched = by_lidar(points, _driven(ride, stamps), params)
    return poses[matched], views.poses[view[matched]]


def places(ride: Ride, views: Views, settings: CameraMount) -> list[tuple[int, int]]:
    """Indices of a sweep and a view for each place where the robot stood during both."""
    still = _standing(ride, views.stamp_s, settings)
    pairs: list[tuple[int, int]] = []
    last = np.full(3, np.inf)
    stamps = np.array([sweep.stamp_s for sweep in ride.sweeps])
    for index in np.flatnonzero(_standing(ride, stamps, settings)):
        near = int(np.argmin(np.where(still, np.abs(views.stamp_s - stamps[index]), np.inf)))
        here, there = ride.odometry.at(np.array([stamps[index], views.stamp_s[near]]))
        together = still[near] and _within(here - there, settings.stand_m, settings.stand_deg)
        if together and not _within(here - last, settings.apart_m, settings.apart_deg):
            pairs.append((int(index), near))
            last = here
    return pairs


def _standing(ride: Ride, stamps_s: Floats, settings: CameraMount) -> NDArray[np.bool_]:
    """(n,) True if the robot has stood for ``stand_s`` and stands a little longer."""
    before, after = (ride.odometry.at(stamps_s + offset) for offset in (-settings.stand_s, 0.5 * settings.stand_s))
    return _within(after - before, settings.stand_m, settings.stand_deg)


def _within(step: Floats, distance_m: float, angle_deg: float) -> NDArray[np.bool_]:
    """(...,) True if (..., 3) differences of x, y and yaw are small."""
    near: NDArray[np.bool_] = np.hypot(step[..., 0], step[..., 1]) <= distance_m
    return near & (np.abs(np.degrees(step[..., 2])) <= angle_deg)


def by_lidar(sweeps: list[Floats], driven: Floats, params: MappingParams) -> tuple[Floats, NDArray[np.bool_]]:
    """((n, 4, 4) poses of the sweeps on their common map, (n,) mask of those that match it)."""
    poses, matched = lidar_odometry(sweeps, driven, params.lidar_odometry)
    thin = [thinned(points, params.refinement) for points in sweeps]
    for _ in range(params.refinement.rounds):
        fits = onto_map(thin, poses, map_of(sweeps, poses, params.refinement), params.refinement, lambda: None)
        matched = np.zeros(len(sweeps), bool)
        matched[fits.second] = True
        poses[fits.second] = fits.measured
    return poses, matched


def lines_of(found: CameraMountFound, frame: str, nominal: Floats, views: Views) -> list[str]:
    """The result in words."""
    angles = turned_by_deg(found.pose[:3, :3], frame)
    before = turned_by_deg(nominal[:3, :3], frame)
    one = np.degrees(found.angle_deviation_rad)
    x, y, z = found.pose[:3, 3]
    moved_mm = 1e3 * (found.pose[:2, 3] - nominal[:2, 3])
    sigma_mm = 1e3 * found.place_deviation_m
    rms = np.sqrt(np.mean(found.residuals**2, axis=0))
    name = frame.removesuffix("_camera")
    return [
        f"{len(found.residuals)} places in front of the markers of {views.dock}; "
        f"{len(views.stamp_s)} of {views.images} images show them",
        "rotation of the camera relative to robot.yaml: "
        + ", ".join(
            f"{axis} {now - old:+.2f} (+- {sigma:.2f})"
            for axis, now, old, sigma in zip(("roll", "pitch", "yaw"), angles, before, one, strict=True)
        )
        + " deg",
        f"translation: {moved_mm[0]:+.1f} (+- {sigma_mm[0]:.1f}) mm ahead, {moved_mm[1]:+.1f} (+- {sigma_mm[1]:.1f}) "
        "mm to the left; measure the height by hand",
        "errors of the camera's intrinsics are not included: 0.3 px correspond to 0.02 deg and about 3 mm",
        f"residual between LiDAR and camera: {1e3 * float(np.linalg.norm(rms[:3])):.1f} mm and "
        f"{float(np.degrees(np.linalg.norm(rms[3:]))):.3f} deg, rms",
        "write into config/robot.yaml, then record another ride: corrections must be near zero:",
        f"  {name}_camera_xyz_m: [{x:.4f}, {y:.4f}, {z:g}]",
        f"  {name}_camera_rpy_deg: [{angles[0]:.2f}, {angles[1]:.2f}, {angles[2]:.2f}]",
        "The docking controller measures the remaining offset between camera and latch when the latch first closes.",
    ]


def draw(found: CameraMountFound, file: Path) -> None:
    """Draws the residual of each view, in plan and in angle. Raises CommandError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for axes, first, scale, unit in ((left, 0, 1e3, "mm"), (right, 3, float(np.degrees(1.0)), "deg")):
        for column, name in enumerate(("x, to the right", "y, down", "z, along the view")):
            axes.plot(scale * found.residuals[:, first + column], ".-", label=name, alpha=0.7)
        axes.set(xlabel="place", ylabel=unit)
    left.set(title="board position, LiDAR relative to camera")
    right.set(title="board angles, LiDAR relative to camera")
    right.legend(title="in the camera's frame")
    with writing(file):
        figure.savefig(file, dpi=_DPI)


def _driven(ride: Ride, stamps_s: Floats) -> Floats:
    return np.array([planar(*row) for row in ride.odometry.at(stamps_s)])


def _grey(message: Any) -> NDArray[np.uint8]:
    """(height, width). Raises ValueError for an image other than mono8."""
    data = np.frombuffer(bytes(message.data), np.uint8)
    if message.encoding not in ("mono8", "8UC1") or message.step < message.width:
        raise ValueError(f"images must be mono8, are {message.encoding} with {message.step} bytes a row")
    if len(data) != message.height * message.step:
        raise ValueError(f"{len(data)} bytes are not {message.height} rows of {message.step}")
    return np.ascontiguousarray(data.reshape(message.height, message.step)[:, : message.width])


def _boards(marker: MarkerObservation, docks: Any) -> list[tuple[str, Floats]]:
    """The dock with this marker, and its board in the camera."""
    return [
        (name, marker.pose @ inverse(dock.markers[marker.marker_id].pose()))
        for name, dock in docks.items()
        if marker.marker_id in dock.markers and not marker.ambiguous
    ]
