"""Compiles or loads the kernels of a sweep before the first one instead of during it."""

from __future__ import annotations

import numpy as np

from robot_stack.drivers.ouster.frame import Frame
from robot_stack.drivers.ouster.geometry import geometry_of
from robot_stack.drivers.ouster.layouts import layout_of
from robot_stack.drivers.ouster.metadata import Metadata
from robot_stack.drivers.ouster.points import Limits, points_of

_BEAMS, _COLUMNS = 2, 512


def warm_up() -> None:
    """One column of a sensor with two beams."""
    metadata = Metadata(
        prod_line="none",
        prod_sn="0",
        lidar_mode=f"{_COLUMNS}x10",
        pixels_per_column=_BEAMS,
        columns_per_frame=_COLUMNS,
        columns_per_packet=16,
        pixel_shift_by_row=(0,) * _BEAMS,
        beam_altitude_angles=(1.0, -1.0),
        beam_azimuth_angles=(0.0,) * _BEAMS,
        lidar_origin_to_beam_origin_mm=10.0,
        lidar_to_sensor_transform=tuple(np.eye(4).ravel().tolist()),
    )
    frame = Frame(metadata, layout_of(metadata, "warm_up"))
    frame.steps[0], frame.valid[0] = 1000, True
    points_of(frame, geometry_of(metadata, np.eye(3)), Limits(1, 100_000, 1e-3))
