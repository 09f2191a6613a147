"""Docking: markers in camera images, and the motion to the dock by them."""
