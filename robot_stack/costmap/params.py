"""Parameters of the node costmap_server, ``config/costmap_server.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class InflationParams(Config):
    """Inflation radius: ``beyond_m`` more than the footprint's circumscribed radius."""

    beyond_m: NotNegative
    scaling_per_m: Positive


class CostmapParams(Config):
    """Everything in ``config/costmap_server.yaml``."""

    inflation: InflationParams
