"""The process of the system monitor."""
