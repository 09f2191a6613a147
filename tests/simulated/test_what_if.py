"""``simulate --from``: a run goes on from a recorded moment of a mission, and is reproducible."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.middleware.conversions import pose_from_msg
from sim.replay.recorded import read_recording
from sim.scheduler.decoding import decoder
from sim.stack.simulate import main

ROWS = (topics.SIM_GROUND_TRUTH, topics.MISSION_STATUS, topics.BATTERY_STATE)


def simulate(output: Path, *arguments: str) -> Any:
    """figures.json of the run."""
    assert main([*arguments, "--light", "--serial", "--no-plots", "--output", str(output)]) == 0
    (folder,) = (item for item in output.iterdir() if item.is_symlink())
    return json.loads((folder / "figures.json").read_text())


def messages(folder: Path, row: topics.Topic, until_s: float) -> list[Any]:
    return [decoder(row.type)(item.data) for item in read_recording(folder, ROWS, until_s).of(row)]


def test_a_run_goes_on_from_a_recorded_moment_of_a_mission(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ride, again = tmp_path / "ride", tmp_path / "again"
    simulate(tmp_path / "a", "mission:short_hop", "--until", "8", "--record", str(ride))
    statuses = messages(ride, topics.MISSION_STATUS, 1e9)
    assert statuses[-1].waypoints_completed >= 1, "the robot has passed a waypoint"
    at_s = 12.0
    here = pose_from_msg(messages(ride, topics.SIM_GROUND_TRUTH, at_s)[-1].pose.pose)
    then = messages(ride, topics.MISSION_STATUS, at_s)[-1]

    capsys.readouterr()
    begin = ("--from", f"{ride}@{at_s:g}", "--until", "3")
    first = simulate(tmp_path / "b", *begin, "--record", str(again))
    text = capsys.readouterr().out
    assert f"as recorded: mission short_hop, {then.waypoints_completed} waypoints done" in text
    assert "not as recorded: the robot starts from rest" in text
    begun = pose_from_msg(messages(again, topics.SIM_GROUND_TRUTH, 1e9)[0].pose.pose)
    assert begun.distance_to(here) < 0.02
    after = messages(again, topics.MISSION_STATUS, 1e9)
    assert {message.state for message in after} == {"PAUSED", "RUNNING"}
    assert after[-1].state == "RUNNING"
    assert min(message.waypoints_completed for message in after) == then.waypoints_completed
    charges = [messages(folder, topics.BATTERY_STATE, 1e9) for folder in (ride, again)]
    assert charges[1][0].percentage == pytest.approx(
        messages(ride, topics.BATTERY_STATE, at_s)[-1].percentage, abs=1e-4
    )
    assert simulate(tmp_path / "c", *begin)["digest"] == first["digest"]
