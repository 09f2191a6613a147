"""The meaning of ``/localization/quality``."""

from __future__ import annotations

from robot_stack.localization.params import QualityParams


def quality(
    position_sigma_m: float, yaw_sigma_rad: float, odometry_age_s: float, gyro_used: bool, params: QualityParams
) -> float:
    """Reliability of the pose, in [0, 1].

    The smaller of 1 / (1 + (sigma / half)^2) for position and yaw, where sigma is the filter's standard deviation (of
    the position along its worst direction) and half the value at which quality is 0.5. A missing gyro multiplies it by
    ``without_gyro_factor``; odometry older than ``odometry_fresh_s`` fades it linearly to 0 at ``odometry_silent_s``.
    """
    position = 1.0 / (1.0 + (position_sigma_m / params.position_half_sigma_m) ** 2)
    yaw = 1.0 / (1.0 + (yaw_sigma_rad / params.yaw_half_sigma_rad) ** 2)
    span_s = params.odometry_silent_s - params.odometry_fresh_s
    fade = (params.odometry_silent_s - odometry_age_s) / span_s
    gyro = 1.0 if gyro_used else params.without_gyro_factor
    value = min(position, yaw) * gyro * min(1.0, max(0.0, fade))
    return value if value == value else 0.0
