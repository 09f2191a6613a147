"""The node of the costmap."""
