"""The drive: from velocity wishes to wheel set points, from encoders to odometry."""
