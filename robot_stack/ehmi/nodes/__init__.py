"""The shell around the serial line."""
