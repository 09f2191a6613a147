"""A battery monitor on Modbus."""
