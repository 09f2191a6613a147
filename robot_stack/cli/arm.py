"""arm: an operator's moves of the manipulator, for use without a motion planner."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.safety import Timeout

arm = typer.Typer(help="Moves the manipulator (profile manipulator) and its gripper.", no_args_is_help=True)

JOINTS = ("joint1", "joint2", "joint3", "joint4", "joint5", "joint6")
Waypoint = tuple[float, Sequence[float]]
# Upright, elbow bent, gripper ahead; then the forearm swings to either side.
_RAISED = (0.0, -0.3, 1.0, 0.0, -1.57, 0.0)
_SWING = (0.3, 0.0, 0.0, 0.5, 0.0, 0.4)
_RAISE_S, _SWING_S = 2.5, 1.0
_LINE_PERIOD_S = 0.5


class Grip(Enum):
    CLOSE = "close"
    OPEN = "open"


@arm.command()
def move(
    to: Annotated[str, typer.Option(metavar="RAD,RAD,...", help="Six joint angles, rad, e.g. --to=0.5,0,0,0,-1,0.")],
    within_s: Annotated[float, typer.Option("--in", metavar="SECONDS", help="How long it may take.")] = 3.0,
    timeout_s: Timeout = 5.0,
) -> None:
    """Move all joints. Ctrl-C stops along the way. Exit code 1 if the arm does not get there."""
    _follow([(_duration(within_s), _angles(to))], timeout_s)


@arm.command()
def wave(
    times: Annotated[int, typer.Option(min=1, max=20, help="Swings to either side.")] = 2,
    timeout_s: Timeout = 5.0,
) -> None:
    """Raise the arm from wherever it is, and wave. It needs room around it. Ctrl-C stops along the way."""
    _follow(waving(times), timeout_s)


@arm.command()
def grip(state: Annotated[Grip, typer.Argument(help="close or open.")], timeout_s: Timeout = 5.0) -> None:
    """Close or open the gripper."""
    from robot_stack.cli.nodes.arm_goals import set_gripper

    success, message = set_gripper(state is Grip.CLOSE, timeout_s)
    if not success:
        raise CommandError(message)
    print(message)


def waving(times: int) -> list[Waypoint]:
    """Waypoints, (s, rad per joint): up, ``times`` swings to either side, and back to the middle."""
    sides = [1.0, -1.0] * times + [0.0]
    points = [[rest + side * swing for rest, swing in zip(_RAISED, _SWING, strict=True)] for side in sides]
    return [(_RAISE_S, _RAISED), *((_RAISE_S + _SWING_S * (n + 1), point) for n, point in enumerate(points))]


def _angles(text: str) -> list[float]:
    try:
        angles = [float(part) for part in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) != len(JOINTS) or not all(map(math.isfinite, angles)):
        raise CommandError(f"--to {text}: must be {len(JOINTS)} angles in rad, joined by commas", WRONG_USE)
    return angles


def _duration(seconds: float) -> float:
    if not 0.0 < seconds <= 600.0:
        raise CommandError(f"--in {seconds:g}: must be above 0 and at most 600 s", WRONG_USE)
    return seconds


def _follow(waypoints: Sequence[Waypoint], timeout_s: float) -> None:
    from robot_stack.cli.nodes.arm_goals import follow_trajectory

    progress = Progress()
    ended = follow_trajectory(JOINTS, waypoints, progress.report, timeout_s)
    if not ended.success:
        raise CommandError(f"failed: {ended.reason}")
    print(f"goal reached; at most {1e3 * progress.worst_rad:.1f} mrad from the spline")


class Progress:
    """Periodically shows the joint positions, and keeps the largest distance from the spline."""

    def __init__(self) -> None:
        self.worst_rad = 0.0
        self._next_s = 0.0

    def report(self, feedback: Any) -> None:
        self.worst_rad = max(self.worst_rad, *map(abs, feedback.error.positions))
        elapsed = feedback.desired.time_from_start
        elapsed_s = elapsed.sec + 1e-9 * elapsed.nanosec
        if elapsed_s >= self._next_s:
            self._next_s = elapsed_s + _LINE_PERIOD_S
            joints = " ".join(f"{angle:+.3f}" for angle in feedback.actual.positions)
            print(f"{elapsed_s:5.1f} s  {joints}", flush=True)
