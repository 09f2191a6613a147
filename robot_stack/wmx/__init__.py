"""The motion engine: port, simulated engine, vendor adapter."""
