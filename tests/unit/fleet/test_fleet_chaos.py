"""Rides of ``robot-stack bench fleet_chaos``: no order is lost, none is driven twice, the state is right soon."""

from __future__ import annotations

import pytest

from tests.support.fleet.chaos import Chaos


@pytest.mark.parametrize("seed", [14, 17, 29])  # without the memory of past orders they fail
def test_orders_end_once_whatever_fails(seed: int) -> None:
    counts = Chaos(seed).run()
    assert counts.kills > 0
    assert counts.outages > 0
    assert counts.recoveries > 0


def test_a_ride_repeats_itself() -> None:
    assert Chaos(0, orders=2).run() == Chaos(0, orders=2).run()
