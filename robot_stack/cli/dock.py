"""dock and undock: an operator's goals for the docking controller, followed to their end."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.cli.safety import Timeout
from robot_stack.contract import actions
from robot_stack.contract.model import Action


def dock(
    dock_id: Annotated[str, typer.Argument(help="Id, as in config/docks.yaml.")],
    timeout_s: Timeout = 5.0,
) -> None:
    """Dock now, without a mission. Ctrl-C cancels and waits until the robot has let go. Exit code 1 if it fails."""
    from robot_stack.core.docks import load_docks

    known = load_docks().docks
    if dock_id not in known:
        raise CommandError(f"there is no dock {dock_id!r}; known: {', '.join(sorted(known))}")
    _follow(actions.DOCK, {"dock_id": dock_id}, _docking_line, timeout_s)
    print(f"docked to {dock_id}")


def undock(timeout_s: Timeout = 5.0) -> None:
    """Undock now, wherever the robot is docked, and back off. Ctrl-C cancels. Exit code 1 if it fails."""
    _follow(actions.UNDOCK, {"dock_id": ""}, _undocking_line, timeout_s)
    print("undocked and clear")


def _follow(row: Action, goal: dict[str, Any], describe: Any, timeout_s: float) -> None:
    from robot_stack.cli.nodes.docking_goals import follow_action

    shown: list[str] = []

    def report(feedback: Any) -> None:
        line = describe(feedback)
        if [line] != shown:
            shown[:] = [line]
            print(line, flush=True)

    ended = follow_action(row, goal, report, timeout_s)
    if not ended.success:
        raise CommandError(f"failed: {ended.reason}")


def _docking_line(feedback: Any) -> str:
    """``SERVOING, try 1, 0.42 m, -1.3 deg``; errors to the centimetre and tenth of a degree, so that lines stay few."""
    parts = [feedback.state, *([f"try {feedback.tries}"] if feedback.tries else [])]
    if math.isfinite(feedback.position_error):
        parts.append(f"{feedback.position_error:.2f} m")
    if math.isfinite(feedback.orientation_error):
        parts.append(f"{math.degrees(feedback.orientation_error):.1f} deg")
    return ", ".join(parts)


def _undocking_line(feedback: Any) -> str:
    return f"{feedback.state}, {feedback.distance:.2f} m"
