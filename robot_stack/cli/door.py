"""confirm-door: staff see that a door without a working interface is open."""

from __future__ import annotations

from typing import Annotated

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.cli.safety import Timeout


def confirm_door(
    name: Annotated[str, typer.Argument(help="The door for which the robot waits.")], timeout_s: Timeout = 5.0
) -> None:
    """Confirm that a door is open, seen on site: the robot that waits for it passes once."""
    from robot_stack.cli.nodes.operator_commands import confirm_door as confirm

    accepted, message = confirm(name, timeout_s)
    if not accepted:
        raise CommandError(message)
    print(message)
