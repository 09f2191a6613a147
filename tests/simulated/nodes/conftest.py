"""A bench for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.simulated.bench import Bench
from tests.simulated.bench import bench as open_bench


@pytest.fixture
def bench() -> Iterator[Bench]:
    with open_bench() as made:
        yield made
