"""view: the live view for Foxglove."""

from __future__ import annotations

import signal
from typing import Annotated

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.contract.model import System


def view(
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="Port on this machine; by default config/view.yaml's.")
    ] = None,
) -> None:
    """Show the running robot live in Foxglove: every topic of the contract, tf, and a model that turns its modules.

    Until Ctrl-C. Only this machine may connect; from elsewhere: ssh -L 8765:localhost:8765 ROBOT. A layout to load into
    the viewer is config/foxglove_layout.json. Topics without a viewer cost nothing.
    """
    from robot_stack.core.config import config_dir, load
    from robot_stack.view.nodes.server import ViewError
    from robot_stack.view.nodes.view import View
    from robot_stack.view.params import ViewParams

    params = load(ViewParams, "view", {} if port is None else {"port": port})
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # SIGTERM ends it like Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with View(params, _machine()) as shown:
            print(f"live view: ws://{params.host}:{shown.port}", flush=True)
            print(f"Foxglove: Open connection, Foxglove WebSocket; layout {config_dir() / 'foxglove_layout.json'}")
            print("Ctrl-C ends it", flush=True)
            shown.run()
    except KeyboardInterrupt:
        pass
    except ViewError as error:
        raise CommandError(str(error)) from None


def _machine() -> System:
    """The machine of the running stack; without one, the robot."""
    from robot_stack.supervisor.control import NotRunning, ask

    try:
        return System(ask("status")["machine"])
    except (NotRunning, TimeoutError):
        return System.ROBOT
