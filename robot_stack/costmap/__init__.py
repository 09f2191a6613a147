"""The local costmap: marking, clearing, decay, inflation."""
