"""The local costmap: inflation of the known space."""
