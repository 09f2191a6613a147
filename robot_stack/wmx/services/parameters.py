"""Parameters of a node that only offers services: ``config/wmx_io_node.yaml`` and its like."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class ServiceNodeParams(Config):
    """retry_s: between looks for an engine that does not run."""

    retry_s: Annotated[float, Field(gt=0.0, le=60.0)]
