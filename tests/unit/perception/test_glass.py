"""A slightly dirty glass pane ahead is an obstacle. Its mirror images lie behind it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.glass import Window, approached, clouds, missed_pct, standing

SEED = 911


@pytest.mark.parametrize(("lit", "course_deg"), [(True, 60.0), (False, 0.0)])
def test_dirty_pane_is_in_every_cloud_during_the_approach(lit: bool, course_deg: float) -> None:
    assert approached(Window(lit, 0.001), [SEED], course_deg) == 0.0


def test_mirror_images_lie_behind_the_pane_and_none_in_front() -> None:
    """A dark shop window mirrors the parked car: phantoms, but behind a real obstacle."""
    missed, behind, before = standing(Window(lit=False, dirt=0.001), 2.0, [SEED])
    assert missed == 0.0
    assert behind > 10.0
    assert before == 0.0


def test_a_spotless_pane_before_a_lit_room_is_seen_where_it_is_met_at_right_angles_and_hardly_elsewhere() -> None:
    """Documents what is not detected: any other detection is due to the simulated dirt, not to the glass."""
    shown = clouds(Window(lit=True, dirt=0.0001), SEED, [5.0] * 12)[-1]
    assert missed_pct(shown) > 50.0
    ahead = (np.abs(shown[:, 0]) < 0.15) & (np.abs(shown[:, 1]) < 0.3)
    assert ahead.any()
