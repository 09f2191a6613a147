"""The ROS nodes of the simulated world: sim_world and the drivers of its sensors. They share one process."""
