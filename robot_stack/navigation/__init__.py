"""From a goal pose to velocity commands: planned motion, tracking, arrival."""
