"""``robot-stack arm``: the wave's waypoints, rejected arguments and printed output."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import pytest

from robot_stack.cli import arm
from robot_stack.cli.errors import WRONG_USE, CommandError


def test_a_wave_swings_to_either_side_and_ends_in_the_middle() -> None:
    waypoints = arm.waving(2)
    assert len(waypoints) == 1 + 4 + 1
    assert all(later[0] > earlier[0] for earlier, later in pairwise(waypoints))
    assert [round(positions[3], 6) for _, positions in waypoints] == [0.0, 0.5, -0.5, 0.5, -0.5, 0.0]
    assert list(waypoints[-1][1]) == list(waypoints[0][1])
    assert all(len(positions) == len(arm.JOINTS) for _, positions in waypoints)


@pytest.mark.parametrize("text", ["1,2,3", "1,2,3,4,5,six", "1,2,3,4,5,nan"])
def test_angles_that_are_not_six_numbers_are_refused(text: str) -> None:
    with pytest.raises(CommandError, match="must be 6 angles in rad") as refused:
        arm.move(to=text, within_s=1.0)
    assert refused.value.code == WRONG_USE


@pytest.mark.parametrize("seconds", [0.0, 601.0, float("nan")])
def test_arm_move_rejects_duration_out_of_range(seconds: float) -> None:
    with pytest.raises(CommandError, match="must be above 0 and at most 600 s"):
        arm.move(to="0,0,0,0,0,0", within_s=seconds)


def test_progress_shows_a_line_each_half_second_and_keeps_the_worst(capsys: pytest.CaptureFixture[str]) -> None:
    progress = arm.Progress()
    for step in range(11):
        progress.report(feedback(0.1 * step, -0.004 if step == 3 else 0.001))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["0.0", "0.5", "1.0"]
    assert lines[1] == "  0.5 s  +0.250 -0.500"
    assert progress.worst_rad == 0.004


def feedback(time_s: float, error: float) -> SimpleNamespace:
    stamp = SimpleNamespace(sec=int(time_s), nanosec=round((time_s - int(time_s)) * 1e9))
    return SimpleNamespace(
        desired=SimpleNamespace(time_from_start=stamp),
        actual=SimpleNamespace(positions=[0.5 * time_s, -time_s]),
        error=SimpleNamespace(positions=[error, 0.0]),
    )
