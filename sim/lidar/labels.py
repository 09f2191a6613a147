"""Label of the object of a simulated point: the ground truth of benchmarks and tests."""

from __future__ import annotations

# PIT: floor and sides of a drop-off, below the ground. MIRROR: seen in wet ground, so where nothing is. NEAR: whatever
# covers the lens. AIRBORNE: a drop, a flake, dust, or nothing but the sun's light.
GROUND, RAMP, KERB, WALL, BOX, CYLINDER, STATION, PERSON, CHAIR, ROBOT, PIT, MIRROR, NEAR, AIRBORNE = range(14)

OF_KIND = {"kerb": KERB, "wall": WALL, "box": BOX, "cylinder": CYLINDER, "ramp": RAMP, "station": STATION}
