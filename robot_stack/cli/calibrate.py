"""calibrate: measures values that differ between robots."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError, writing

_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
_NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")

calibrate = typer.Typer(help="Calibrate one robot: cameras, LiDAR, wheels.", no_args_is_help=True)


@calibrate.command()
def camera(
    folder: Annotated[Path | None, typer.Argument(help="Folder with pictures of the ChArUco board.")] = None,
    frame: Annotated[str, typer.Option(help="Camera of the pictures.")] = "front_camera",
    output: Annotated[
        Path | None, typer.Option(help="camera_info YAML to write; by default the camera's own in config/cameras.")
    ] = None,
    board_pdf: Annotated[Path | None, typer.Option(help="Write the board to scale into this PDF, then end.")] = None,
) -> None:
    """Calibrate a camera from pictures of a ChArUco board and write its camera_info YAML."""
    from robot_stack.cli.charuco import load_charuco, write_board_pdf

    params = load_charuco()
    if board_pdf is not None:
        with writing(board_pdf):
            write_board_pdf(board_pdf, params)
        typer.echo(f"{board_pdf}: {params.columns} x {params.rows} squares of {1e3 * params.square_m:g} mm")
    elif folder is None:
        raise CommandError("name a folder of pictures, or a file for the board: --board-pdf FILE", WRONG_USE)
    else:
        _calibrate(folder, frame, output)


@calibrate.command()
def lidar(
    recording: Annotated[Path, typer.Argument(help="Ride of a full circle and more, made by robot-stack record.")],
    rpy_deg: Annotated[
        tuple[float, float, float] | None,
        typer.Option(help="The LiDAR's rpy_deg in robot.yaml during the recording; by default the present value."),
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Plot measurements and residuals into this PNG.")] = None,
) -> None:
    """Calibrate the LiDAR's mounting: tilt and height from the ground, heading from its path."""
    from robot_stack.cli.calibrate_lidar import calibrate_lidar

    if rpy_deg is not None and not all(-180.0 <= angle <= 180.0 for angle in rpy_deg):
        raise CommandError(f"rpy-deg must be three angles of -180 to 180 deg, is {rpy_deg}", WRONG_USE)
    calibrate_lidar(recording, rpy_deg, picture)


@calibrate.command()
def extrinsics(
    recording: Annotated[Path, typer.Argument(help="Ride before a dock's markers, made by robot-stack record.")],
    frame: Annotated[str, typer.Option(help="Camera: front_camera or rear_camera.")] = "front_camera",
    picture: Annotated[Path | None, typer.Option(help="Plot the residuals into this PNG.")] = None,
) -> None:
    """Calibrate a camera's mounting relative to the LiDAR, from a ride in front of fixed markers."""
    from robot_stack.cli.calibrate_extrinsics import calibrate_extrinsics

    calibrate_extrinsics(recording, frame, picture)


@calibrate.command()
def wheels(
    recording: Annotated[Path, typer.Argument(help="Ride ahead and sideways, made by robot-stack record.")],
    picture: Annotated[Path | None, typer.Option(help="Plot the differences into this PNG.")] = None,
) -> None:
    """Calibrate the differences of the wheel radii and the offsets of the steering encoders."""
    from robot_stack.cli.calibrate_wheels import calibrate_wheels

    calibrate_wheels(recording, picture)


def _calibrate(folder: Path, frame: str, output: Path | None) -> None:
    from robot_stack.cli.charuco import CalibrationError, load_charuco
    from robot_stack.cli.charuco import calibrate as solve
    from robot_stack.core.camera import camera_file, load_intrinsics, write_intrinsics

    own = camera_file(frame)
    target = output or own
    if not own.is_file():
        known = ", ".join(sorted(path.stem for path in own.parent.glob("*.yaml")))
        raise CommandError(f"no camera {frame!r}; there are {known}", WRONG_USE)
    before = load_intrinsics(own)
    pictures = _read(folder)
    for name, picture in pictures.items():
        if picture.shape != (before.height, before.width):
            size = f"{picture.shape[1]}x{picture.shape[0]}"
            raise CommandError(f"{name} is {size}; {frame} takes pictures of {before.width}x{before.height}")
    try:
        result = solve(pictures, load_charuco())
    except CalibrationError as error:
        raise CommandError(str(error)) from None
    now = result.intrinsics
    worst = max(result.errors_px, key=lambda name: result.errors_px[name])
    typer.echo(f"{len(result.errors_px)} of {len(pictures)} pictures used")
    typer.echo(f"reprojection error {result.error_px:.3f} px, worst {result.errors_px[worst]:.3f} px in {worst}")
    values = (now.fx, now.fy, now.cx, now.cy, *now.distortion)
    for name, value, sigma in zip(_NAMES, values, result.sigmas, strict=True):
        typer.echo(f"  {name:<3}{value:12.5f}  +- {sigma:.5f}")
    with writing(target):
        write_intrinsics(target, frame, now)
    typer.echo(f"written: {target}")


def _read(folder: Path) -> dict[str, Any]:
    """Greyscale pictures (height, width) by file name."""
    import cv2

    if not folder.is_dir():
        raise CommandError(f"{folder} is no folder", WRONG_USE)
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in _PICTURES)
    if not files:
        raise CommandError(f"{folder} has no pictures ({', '.join(_PICTURES)})")
    pictures: dict[str, Any] = {}
    for path in files:
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise CommandError(f"{path} cannot be read as a picture")
        pictures[path.name] = picture
    return pictures
