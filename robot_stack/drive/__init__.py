"""The drive: from velocity commands to wheel set points, from encoders to odometry."""
