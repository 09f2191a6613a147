"""The whole stack on the deterministic scheduler: nodes, physics, sensors, people and staff in one process."""
