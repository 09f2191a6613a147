"""A battery monitor that is asked over Modbus."""
