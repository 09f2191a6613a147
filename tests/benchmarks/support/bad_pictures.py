"""Randomly drawn conditions that degrade images, for the marker benchmark."""

from __future__ import annotations

import math

import numpy as np

from robot_stack.core.camera import Intrinsics
from sim.camera.conditions import CLEAR, Conditions, Glare, Shadow


def clear(_: np.random.Generator, __: Intrinsics) -> Conditions:
    return CLEAR


def _glare(random: np.random.Generator, camera: Intrinsics) -> Conditions:
    u, v = random.uniform(0.0, camera.width), random.uniform(0.0, camera.height)
    return Conditions(glare=Glare(u, v, random.uniform(60.0, 200.0), random.uniform(20.0, 60.0)))


def _rain(random: np.random.Generator, _: Intrinsics) -> Conditions:
    return Conditions(rain=random.uniform(0.2, 0.7), illumination=0.5)


def _blur(random: np.random.Generator, _: Intrinsics) -> Conditions:
    return Conditions(blur_px=random.uniform(0.8, 2.0))


def _dirt(random: np.random.Generator, _: Intrinsics) -> Conditions:
    dirty = random.permutation(4)[: random.integers(1, 4)]
    return Conditions(dirt={int(marker): random.uniform(0.05, 0.4) for marker in dirty})


def _shadow(random: np.random.Generator, _: Intrinsics) -> Conditions:
    return Conditions(
        shadow=Shadow(
            random.uniform(-0.25, 0.25),
            random.uniform(0.0, 2.0 * math.pi),
            random.choice([0.0, 0.03]),
            random.uniform(0.5, 0.85),
        )
    )


BAD = {"glare": _glare, "rain": _rain, "blur": _blur, "dirt": _dirt, "shadow": _shadow}
