"""The cameras of the simulation: true optics, the marker boards, and all disturbances of a picture."""
