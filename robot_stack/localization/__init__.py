"""Localization: fuses wheel odometry, gyro and map matches into the pose in map."""
