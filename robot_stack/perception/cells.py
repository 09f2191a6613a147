"""Labels of the profile's cells and of points."""

from __future__ import annotations

# Cells. STEP: a kerb's height above the ground before it. TALL: more. DROP: below it.
EMPTY, FLOOR, STEP, TALL, DROP = 0, 1, 2, 3, 4
# Points. LOW: too high for ground, too low for an obstacle, and no kerb. HIGH: above the robot.
UNKNOWN, GROUND, KERB, OBSTACLE, LOW, HIGH = 0, 1, 2, 3, 4, 5
