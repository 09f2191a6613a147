"""A joystick with a dead-man button, by the kernel's joystick interface."""
