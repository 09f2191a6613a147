"""What the tests share: conditions with deadlines, ROS domains of their own, real node processes."""
