"""pin: the hash of a staff PIN, for config/touch_ui.yaml."""

from __future__ import annotations

from typing import Annotated

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError


def pin(
    digits: Annotated[str, typer.Option("--pin", prompt="PIN", confirmation_prompt=True, hide_input=True)],
) -> None:
    """Print the line of config/touch_ui.yaml that lets staff in with this PIN (4 to 12 digits)."""
    from robot_stack.ui.pin import hash_pin

    try:
        print(f'  pin_hash: "{hash_pin(digits)}"')
    except ValueError as error:
        raise CommandError(str(error), WRONG_USE) from None
