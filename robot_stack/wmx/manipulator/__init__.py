"""The manipulator: bringing its joints up, and telling where they are."""
