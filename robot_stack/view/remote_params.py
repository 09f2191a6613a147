"""Parameters of the remote view, ``config/remote_view.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot_stack.core.config import Config


class RemoteCloudParams(Config):
    """A cloud of at most ``points_max`` points, one for each voxel of ``voxel_m`` or larger, within ``range_m``."""

    range_m: Annotated[float, Field(ge=1.0, le=200.0)]
    voxel_m: Annotated[float, Field(ge=0.05, le=5.0)]
    points_max: Annotated[int, Field(ge=100, le=5000)]


class RemoteImageParams(Config):
    width_px: Annotated[int, Field(ge=160, le=1280)]
    jpeg_quality: Annotated[int, Field(ge=10, le=95)]


class RemoteViewParams(Config):
    cloud: RemoteCloudParams
    image: RemoteImageParams
