"""The simulated robot's own computer: its kernel's data, its disk, and the browser on its screen."""
