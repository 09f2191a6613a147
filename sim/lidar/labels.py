"""What a point of a simulated sweep lies on: the truth that benches and tests compare with."""

from __future__ import annotations

GROUND, RAMP, KERB, WALL, BOX, CYLINDER, STATION, PERSON, CHAIR, ROBOT, PIT, MIRROR, NEAR = range(13)

# By label. PIT: floor and sides of a drop-off, below the ground. MIRROR: seen in wet ground, so where nothing is.
# NEAR: whatever covers the lens.
NAMES = (
    "ground",
    "ramp",
    "kerb",
    "wall",
    "box",
    "cylinder",
    "station",
    "person",
    "chair",
    "robot",
    "pit",
    "mirror",
    "near",
)

OF_KIND = {"kerb": KERB, "wall": WALL, "box": BOX, "cylinder": CYLINDER, "ramp": RAMP, "station": STATION}

# What a robot can drive on.
DRIVABLE = (GROUND, RAMP)
