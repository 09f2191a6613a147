"""Coordinate frames (REP 105) and joint names of the robot."""

MAP = "map"
ODOM = "odom"
BASE_LINK = "base_link"  # robot centre on the ground, x forward, y left
IMU = "imu"
LIDAR = "lidar"
OVERHEAD_LIDAR = "overhead_lidar"
FRONT_CAMERA = "front_camera"
REAR_CAMERA = "rear_camera"

MODULES = ("fl", "fr", "rl", "rr")  # module ids 0-3
# Joints, and the indices of the two kinds in them. config/robot.yaml gives each joint its axis of the motion engine.
JOINTS = tuple(f"{module}_{part}" for module in MODULES for part in ("drive", "steer"))
DRIVE_AXES = (0, 2, 4, 6)
STEER_AXES = (1, 3, 5, 7)


def steering_link(module: str) -> str:
    """The frame that turns with a module's steering: at the wheel's centre, axes of base_link at steering angle 0."""
    return f"{module}_steering"


def wheel_link(module: str) -> str:
    """The frame that rolls with a module's wheel: y is the axle."""
    return f"{module}_wheel"
