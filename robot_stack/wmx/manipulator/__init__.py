"""The manipulator: bring-up of its joints, and their feedback."""
