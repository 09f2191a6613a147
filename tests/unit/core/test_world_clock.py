"""When a simulated world is reported as slow. The clock itself: ``test_shared_page``."""

from __future__ import annotations

import pytest

from robot_stack.core.world_clock import slow_text


@pytest.mark.parametrize(
    ("pace", "speed", "text"),
    [
        (0.7, 1.0, "simulation at 0.7x"),
        (0.96, 1.0, ""),
        (1.5, 2.0, "simulation at 1.5x"),
        (1.95, 2.0, ""),
        (0.0, 1.0, ""),  # pace not set yet
    ],
)
def test_a_world_is_slow_by_the_speed_it_should_have(pace: float, speed: float, text: str) -> None:
    assert slow_text(pace, speed) == text
