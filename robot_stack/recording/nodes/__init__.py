"""The recorder's node."""
