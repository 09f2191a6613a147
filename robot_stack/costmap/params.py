"""Parameters of the node costmap_server, ``config/costmap_server.yaml``."""

from __future__ import annotations

from robot_stack.core.config import Config, NotNegative, Positive


class InflationParams(Config):
    """Inflation radius: ``beyond_m`` more than the footprint's circumscribed radius."""

    beyond_m: NotNegative
    scaling_per_m: Positive


class CostmapParams(Config):
    """Everything in ``config/costmap_server.yaml``."""

    inflation: InflationParams
