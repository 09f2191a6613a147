"""An engine in a thread of its own, one for each module."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.unit.wmx.harness import Harness, ThreadHarness, runtime_folder


@pytest.fixture(scope="module")
def harness() -> Iterator[Harness]:
    with runtime_folder() as folder:
        harness = ThreadHarness(folder)
        yield harness
        harness.stop()
