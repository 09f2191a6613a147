"""estop and reset: the two keys of the emergency stop."""

from __future__ import annotations

from typing import Annotated

import typer

from robot_stack.cli.errors import CommandError

Timeout = Annotated[float, typer.Option("--timeout", help="Seconds to wait for the answer.")]


def estop(timeout_s: Timeout = 5.0) -> None:
    """Emergency stop, now. Returns when the safety monitor shows it; exit code 1 if it does not."""
    from robot_stack.cli.nodes.wishes import emergency_stop

    shown_after_s = emergency_stop(timeout_s)
    if shown_after_s is None:
        raise CommandError("the stop was sent, but the safety monitor did not confirm it: use the button")
    print(f"emergency stop, confirmed after {shown_after_s:.2f} s; `robot-stack reset` releases it")


def reset(timeout_s: Timeout = 5.0) -> None:
    """Release the emergency stop. The safety monitor refuses while a source is pressed or the robot moves."""
    from robot_stack.cli.nodes.wishes import reset as ask_for_reset

    try:
        granted, reason = ask_for_reset(timeout_s)
    except TimeoutError as error:
        raise CommandError(str(error)) from None
    if not granted:
        raise CommandError(f"refused: {reason}")
    print(f"released{': ' if reason else ''}{reason}")
