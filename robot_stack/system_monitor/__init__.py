"""State of the robot and its computer: ``/robot_status``, diagnostics as a tree, the graph."""
