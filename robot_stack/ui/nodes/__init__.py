"""Node ``touch_ui``, its web server and what they read and write."""
