"""Shared parameters of drivers on a serial line."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class SerialParams(Config):
    """port: a device; a relative name lies in the runtime folder. reopen_s: pause after a failed open.

    silent_s: silence after which the port is closed and reopened: some adapters hang without an error.
    """

    port: Annotated[str, Field(min_length=1)]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]
    silent_s: Annotated[float, Field(gt=0.0, le=60.0)]
