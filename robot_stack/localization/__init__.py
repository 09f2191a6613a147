"""Where the robot is: wheel odometry and gyro fused into the pose in map."""
