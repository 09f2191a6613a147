"""Times of the middleware on the clock of a simulated world."""

from __future__ import annotations

from robot_stack.middleware.world_times import WorldTimes

MS = 1_000_000


class Clocks:
    """Two clocks of which the world's runs at half speed."""

    def __init__(self) -> None:
        self.system_ns, self.world_ns = 1_000_000 * MS, 50 * MS
        self.times = WorldTimes(lambda: self.system_ns, lambda: self.world_ns)

    def advance(self, system_ms: int, world_ms: int) -> None:
        self.system_ns += system_ms * MS
        self.world_ns += world_ms * MS


def test_a_time_between_two_readings_is_interpolated() -> None:
    clocks = Clocks()
    clocks.times.at(clocks.system_ns)
    begin_ns = clocks.system_ns
    clocks.advance(100, 50)
    assert clocks.times.at(begin_ns + 20 * MS) == 60 * MS
    assert clocks.times.at(begin_ns + 80 * MS) == 90 * MS


def test_a_time_beyond_the_readings_is_that_of_the_nearest() -> None:
    clocks = Clocks()
    assert clocks.times.at(clocks.system_ns - 500 * MS) == 50 * MS
    clocks.advance(100, 50)
    assert clocks.times.at(clocks.system_ns + 500 * MS) == 100 * MS


def test_each_reading_counts_for_its_own_stretch() -> None:
    clocks = Clocks()
    begin_ns = clocks.system_ns
    clocks.times.at(begin_ns)
    clocks.advance(100, 0)  # the world waits
    clocks.times.at(clocks.system_ns)
    clocks.advance(100, 100)
    assert clocks.times.at(begin_ns + 50 * MS) == 50 * MS
    assert clocks.times.at(begin_ns + 150 * MS) == 100 * MS


def test_a_restarted_world_begins_again() -> None:
    clocks = Clocks()
    clocks.times.at(clocks.system_ns)
    clocks.advance(100, -50)
    assert clocks.times.at(clocks.system_ns) == 0
