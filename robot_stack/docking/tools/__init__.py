"""Tools of docking: marker boards on paper, and why a docking failed."""
