"""Each scenario is a whole robot and its world, which need both cores of a fast machine for real time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support import waiting

_SLOWER = 4.0


@pytest.fixture(scope="package", autouse=True)
def patience() -> Iterator[None]:
    waiting.patience = _SLOWER
    yield
    waiting.patience = waiting.USUAL_PATIENCE
