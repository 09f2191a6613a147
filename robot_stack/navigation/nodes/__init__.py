"""What node ``navigation_controller`` publishes for pictures."""
