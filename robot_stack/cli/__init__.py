"""The command ``robot-stack``. ROS is imported only by the verbs that need it, so that the others answer at once."""

from __future__ import annotations

import sys


def main() -> None:
    """Runs the command line. Exit codes: 0 done, 1 not done or not well, 2 wrong use or configuration."""
    from robot_stack.cli.app import app
    from robot_stack.cli.errors import exit_code

    try:
        app()
    except Exception as error:
        code = exit_code(error)
        if code is None:
            raise
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(code) from None
