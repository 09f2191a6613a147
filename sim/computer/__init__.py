"""The simulated robot's own computer: what its kernel tells, its disk, and the browser on its screen."""
