"""The simulated LiDAR: ray casting, surfaces, noise and faults."""
