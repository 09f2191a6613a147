"""Cameras by Video4Linux: content and time of exposure of their buffers."""
