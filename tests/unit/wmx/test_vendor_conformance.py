"""The vendor adapter must do what any implementation of the port does.

Twice: on the fake of the vendor's module, of a version whose numbers, names and shapes all differ from the port's; and
on the vendor's library itself wherever the environment names it.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.unit.wmx.conformance import EngineConformance
from tests.unit.wmx.vendor_harness import VendorHarness, vendor_harness


@pytest.fixture(scope="module")
def engine() -> Iterator[VendorHarness]:
    with vendor_harness("newer") as harness:
        yield harness


@pytest.fixture
def harness(engine: VendorHarness) -> Iterator[VendorHarness]:
    engine.module.CONTROL.faults.clear()
    yield engine
    engine.end_test()
    assert engine.module.CONTROL.faults == []


class TestAdapterOnTheFake(EngineConformance):
    """Every conformance test."""
