"""Each scenario runs a whole robot and its world, which need both cores of a fast machine for real time."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import pytest

from tests.support import waiting

_SLOWER = 4.0
# The niceness of the stack's critical processes: a simulation at full speed leaves no CPU time to lower priorities.
_NICENESS = -10


@pytest.fixture(scope="package", autouse=True)
def patience() -> Iterator[None]:
    waiting.patience = _SLOWER
    yield
    waiting.patience = waiting.USUAL_PATIENCE


@pytest.fixture(scope="package", autouse=True)
def priority() -> Iterator[None]:
    """Gives the test the stack's priority. Without the privilege all processes have the same priority."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)
    yield
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, before)
