"""The drive: computes wheel set points from velocity commands, and odometry from encoders."""
