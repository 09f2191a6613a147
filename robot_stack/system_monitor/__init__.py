"""What the robot and its computer are doing: ``/robot_status``, diagnostics as a tree, the graph."""
