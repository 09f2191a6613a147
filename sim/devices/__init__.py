"""Devices at their wires, byte by byte, for the drivers of real devices."""
