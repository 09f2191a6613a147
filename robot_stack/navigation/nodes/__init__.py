"""The node ``navigation_controller``, its messages and markers."""
