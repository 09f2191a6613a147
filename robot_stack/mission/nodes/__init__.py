"""The mission manager's node and its parts."""
