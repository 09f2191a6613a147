"""The node of the perception pipeline, and what only it needs."""
