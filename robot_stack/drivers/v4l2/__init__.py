"""Cameras by Video4Linux: what their buffers hold, and whose moment they show."""
