"""Node ``touch_ui``, its web server, inputs and outputs."""
