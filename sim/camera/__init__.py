"""The cameras of the simulation: true optics, the boards they look at, and everything that spoils a picture."""
