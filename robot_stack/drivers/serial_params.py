"""What drivers on a serial line share."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class SerialParams(Config):
    """port: a device; a relative name lies in the runtime folder. reopen_s: pause after an open that failed.

    silent_s: without a byte for so long the port is closed and opened anew: some adapters hang without an error.
    """

    port: Annotated[str, Field(min_length=1)]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]
    silent_s: Annotated[float, Field(gt=0.0, le=60.0)]
