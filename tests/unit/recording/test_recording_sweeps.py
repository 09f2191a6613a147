"""Which sweeps are recorded."""

from __future__ import annotations

from fnmatch import fnmatchcase

import pytest

from robot_stack.contract import topics
from robot_stack.core.config import ConfigError, load
from robot_stack.recording.params import BlackBoxParams, RecorderParams, SelectionParams
from robot_stack.recording.selection import selected
from robot_stack.recording.sweeps import SweepChoice

SWEEPS = (topics.LIDAR_POINTS, topics.LIDAR_HALF_SWEEP, topics.OVERHEAD_LIDAR_POINTS)


@pytest.mark.parametrize(
    ("mode", "subscribes", "thins"), [("always", True, False), ("never", False, False), ("thinned", True, True)]
)
def test_modes(mode, subscribes, thins):
    choice = SweepChoice(mode, 2.0)
    for row in topics.TOPICS:
        assert choice.subscribes(row) == (subscribes or row not in SWEEPS)
        assert choice.thins(row) == (thins and row in SWEEPS)


def test_two_of_ten_a_second():
    choice = SweepChoice("thinned", 2.0)
    times = [0.1 * number for number in range(100)]
    assert sum(choice.keeps(topics.LIDAR_POINTS.name, now) for now in times) == 20


def test_the_configured_recorder_does_not_fill_the_disk():
    params = load(RecorderParams, "recorder")
    assert (params.sweeps, params.sweep_rate_hz) == ("thinned", 2.0)
    assert any(fnmatchcase(topics.LIDAR_HALF_SWEEP.name, pattern) for pattern in params.exclude)
    assert not any(fnmatchcase(topics.LIDAR_POINTS.name, pattern) for pattern in params.exclude)


@pytest.mark.parametrize(("model", "name"), [(RecorderParams, "recorder"), (BlackBoxParams, "black_box")])
def test_copies_for_remote_viewers_are_not_recorded(model: type[SelectionParams], name: str) -> None:
    params = load(model, name)
    rows = selected(params, name)
    assert not set(rows) & set(topics.REMOTE_COPIES)
    assert {topics.LIDAR_POINTS, topics.FRONT_IMAGE, topics.CURRENT_POSE} <= set(rows)
    with pytest.raises(ConfigError, match="leave no topic"):
        selected(params.model_copy(update={"include": ("/remote/*",)}), name)
