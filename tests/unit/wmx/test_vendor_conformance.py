"""The vendor adapter must meet the requirements for any implementation of the port.

Twice: on the fake of the vendor's module, in a version whose numbers, names and shapes all differ from the port's;
and on the vendor's library itself if the environment names it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.wmx import conformance
from tests.unit.wmx.conformance import CallConformance
from tests.unit.wmx.harness import Harness
from tests.unit.wmx.motion_conformance import EngineConformance
from tests.unit.wmx.vendor_harness import LIBRARY_VARIABLE, RealHarness, VendorHarness, vendor_harness


@pytest.fixture(scope="module")
def engine() -> Iterator[VendorHarness]:
    with vendor_harness("newer") as harness:
        yield harness


class TestAdapterOnTheFake(CallConformance):
    """Every call. The motion of the fake is the simulated engine's (test_process.py)."""

    @pytest.fixture
    def harness(self, engine: VendorHarness) -> Iterator[VendorHarness]:
        engine.module.CONTROL.faults.clear()
        yield engine
        engine.end_test()
        assert engine.module.CONTROL.faults == []


if LIBRARY_VARIABLE in os.environ:

    class TestVendorLibrary(EngineConformance):
        """Every conformance test on the vendor's engine. IT MOVES AXES 0 TO 4: virtual ones, or free to turn."""

        @pytest.fixture
        def harness(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Harness]:
            real = RealHarness(tmp_path)
            monkeypatch.setattr(conformance, "engine_state", lambda _: real.engine_state())
            yield real
            real.end_test()

else:

    @pytest.mark.skip(reason=f"{LIBRARY_VARIABLE} names no library of the vendor to test")
    def test_vendor_library() -> None:
        """Represents the conformance suite on the vendor's library in the report."""
