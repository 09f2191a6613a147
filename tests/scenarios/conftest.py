"""Each scenario is a whole robot and its world, which need both cores of a fast machine for real time."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest

from tests.support import waiting

_SLOWER = 4.0
# That of the stack's critical processes: a world that runs as fast as the machine can leaves nothing to anybody below.
_NICENESS = -10


@pytest.fixture(scope="package", autouse=True)
def patience() -> Iterator[None]:
    waiting.patience = _SLOWER
    yield
    waiting.patience = waiting.USUAL_PATIENCE


@pytest.fixture(scope="package", autouse=True)
def priority() -> Iterator[None]:
    """Whoever operates the robot is not starved by it. Without the privilege all have the same priority anyway."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    yield
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, before)
