"""The processes of the safety subsystem."""
