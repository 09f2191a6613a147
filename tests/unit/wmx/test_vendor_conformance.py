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
from tests.unit.wmx.conformance import EngineConformance
from tests.unit.wmx.conftest import ALL_VARIABLE
from tests.unit.wmx.harness import Harness
from tests.unit.wmx.vendor_harness import LIBRARY_VARIABLE, RealHarness, VendorHarness, vendor_harness

# Tests of engine motion, which the fake takes from the simulated engine, whose own suites run them all.
KINEMATICS = (
    "test_override_that_cannot_stop_in_time",
    "test_estop_stops_every_kind_of_motion",
    "test_estop_wins_over_a_stop",
    "test_quick_stop_overrides_stop_and_not_the_reverse",
    "test_stop_uses_the_commands_own_deceleration",
    "test_velocity_over_velocity_keeps_the_ramps",
    "test_reversal_falls_at_dec_and_grows_at_acc",
    "test_timed_motion_ends_by_itself",
    "test_position_motion_keeps_its_limits",
    "test_new_command_replaces_the_end_of_a_timed_one",
    "test_idle_client_keeps_device_and_motion",
    "test_release_during_emergency_stop_ramp_completes_stop",
    "test_time_acc_profile",
    "test_closing_the_device_leaves_its_spline_to_its_end",
    "test_stop_of_one_axis_stops_all_along_the_path",
    "test_quick_stop_of_a_spline_is_not_softened",
)


@pytest.fixture(scope="module")
def engine() -> Iterator[VendorHarness]:
    with vendor_harness("newer") as harness:
        yield harness


class TestAdapterOnTheFake(EngineConformance):
    """The conformance tests except kinematics, with fewer values; ROBOT_STACK_WMX_CONFORMANCE=all runs everything."""

    if os.environ.get(ALL_VARIABLE) != "all":
        for _name in KINEMATICS:
            assert hasattr(EngineConformance, _name), f"there is no {_name}"
            locals()[_name] = None

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
