"""Node processes of the drive."""
