"""ROS 2 stack of an outdoor wheelchair-transport robot with four swerve modules, driven through a WMX motion engine."""

__version__ = "0.1.0"
