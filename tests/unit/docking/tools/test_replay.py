"""robot-stack docking replay: its reports on recordings with known faults."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import cv2
import pytest

from robot_stack.cli.docking_replay import collect, limits_of, replay_recording
from robot_stack.cli.errors import CommandError
from robot_stack.cli.recordings import recording_files
from robot_stack.contract import topics
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.docking.params import DockingParams
from robot_stack.docking.tools.report import numbers
from robot_stack.docking.tools.shots import strip
from tests.unit.docking.tools.bags import Story, make, success

PARAMS = load(DockingParams, "docking_controller")
DOCKS = load_docks()


@pytest.fixture
def story(tmp_path: Path) -> Story:
    return Story(tmp_path / "ride")


def dockings(folder: Path) -> list[dict]:
    traces, _ = collect(recording_files(folder), PARAMS)
    return [numbers(trace, limits_of(PARAMS), DOCKS) for trace in traces]


# A recording is a list of steps: (state, seconds, further arguments of ``run``), or changes of the story's fields.
Step = tuple[Any, ...] | dict[str, Any]
LOST_MARKERS: list[Step] = [
    ("IDLE", 1.0),
    ("APPROACH", 2.0),
    ("SEARCH", 1.0),
    ("SERVOING", 3.0, 0.4, 0.02),
    {"markers": 0},
    ("SERVOING", 5.0),
    ("SEARCH", 3.0),
    ("FAILED", 1.5),
]


def send(story: Story, steps: list[Step]) -> Story:
    for step in steps:
        if isinstance(step, dict):
            for name, value in step.items():
                setattr(story, name, value)
        else:
            story.run(*step)
    return story


@pytest.mark.parametrize(
    ("steps", "verdict", "further"),
    [
        (LOST_MARKERS, "failed in SEARCH after 14.0 s: markers lost for 8.0 s from t=6.0 s", None),
        (
            [{"markers": 0}, ("IDLE", 0.5), ("APPROACH", 1.0), ("SEARCH", 4.0), ("FAILED", 1.0)],
            "failed in SEARCH after 5.0 s: no marker was found for 4.0 s from t=1.0 s",
            None,
        ),
        (
            [("IDLE", 1.0), ("SERVOING", 3.0, 0.3), {"camera": False}, ("SERVOING", 2.0), ("FAILED", 1.0)],
            "failed in SERVOING after 5.0 s: front camera silent for 2.1 s from t=2.9 s",
            "markers lost for 2.0 s from t=3.0 s",
        ),
        (
            [("IDLE", 1.0), {"camera": False}, ("IDLE", 3.0), ("APPROACH", 2.0), ("SEARCH", 2.0), ("FAILED", 1.0)],
            "failed in SEARCH after 4.0 s: front camera silent for 4.0 s from t=0.0 s",
            None,
        ),
        (
            [{"camera": False}, ("IDLE", 1.0), ("SEARCH", 2.0), ("FAILED", 1.0)],
            "failed in SEARCH after 2.0 s: no marker was found for 2.0 s from t=0.0 s",
            "no camera is in the recording",
        ),
        (
            [("IDLE", 0.5), ("SERVOING", 2.0, 0.1, 0.01), ("FINE_ALIGN", 3.0, 0.0031, 0.007), ("FAILED", 1.0)],
            "failed in FINE_ALIGN after 5.0 s: error did not converge: 3.1 mm and 0.40 deg, best 3.1 mm and 0.40 deg, "
            "needed 2 mm and 0.3 deg",
            None,
        ),
        (
            [("IDLE", 0.5), ("FINE_ALIGN", 2.0, 0.02), {"error_m": 0.22}, ("FINE_ALIGN", 0.5), ("FAILED", 1.0)],
            "failed in FINE_ALIGN after 2.5 s: the dock moved, or its pose jumped: error +200 mm at t=2.0 s",
            None,
        ),
        ([("SERVOING", 3.0, 0.2)], "the recording ends in SERVOING after 2.9 s: error did not converge", None),
    ],
    ids=["markers lost", "no markers", "camera", "camera from the start", "no camera", "error", "moved", "cut off"],
)
def test_failures_are_named_with_their_causes(
    story: Story, steps: list[Step], verdict: str, further: str | None
) -> None:
    (docking,) = dockings(send(story, steps).close())
    assert not docking["success"]
    assert docking["verdict"].startswith(verdict)
    if further is not None:
        assert [item["text"] for item in docking["causes"][1:]] == [further]
    assert docking["begins_before_recording"] is (docking["ended_in"] is None)
    assert (docking["dock"] is None) == ("no marker" in verdict or "from t=0.0 s" in verdict)


def test_a_success(story):
    success(story)
    (docking,) = dockings(story.close())
    assert docking["success"]
    assert docking["dock"] == "chair_1"
    assert docking["camera"] == "front_camera"
    assert docking["verdict"] == "docked after 13.0 s with 0.8 mm and 0.06 deg, passenger attached"
    states = {item["state"]: item["duration_s"] for item in docking["states"]}
    assert list(states) == ["APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN", "DOCKED"]
    assert list(states.values()) == pytest.approx([2.0, 1.0, 5.0, 4.0, 1.0], abs=1e-3)
    assert docking["errors"]["least_m"] == pytest.approx(0.0008, rel=1e-4)
    assert docking["effort_max_nm"] == 3.5
    assert docking["speed"]["driven_max_mps"] == pytest.approx(0.12)
    assert docking["causes"] == docking["other_findings"] == docking["safety"] == docking["limits"] == []


def test_a_latch_that_does_not_confirm_and_a_second_try(story):
    story.run("IDLE", 0.5)
    story.run("FINE_ALIGN", 1.0, 0.001, 0.001)
    story.run("DOCKED", 2.0)
    story.run("APPROACH", 2.0)
    story.run("FINE_ALIGN", 1.0, 0.001, 0.001)
    story.run("DOCKED", 2.0)
    story.run("FAILED", 1.0)
    (docking,) = dockings(story.close())
    assert docking["tries"] == 2
    assert (
        docking["verdict"] == "failed in DOCKED after 8.0 s: the latch did not confirm: DOCKED for 2.0 s from t=6.0 s"
    )
    assert [item["text"] for item in docking["other_findings"]] == [
        "the latch did not confirm: DOCKED for 2.0 s from t=1.0 s"
    ]


def test_emergency_stop_is_reported_before_its_consequences(story):
    story.run("IDLE", 0.5)
    story.run("SERVOING", 2.0, 0.1)
    story.emergency, story.faults = True, ("ESTOP_PRESSED",)
    story.write(topics.VELOCITY_LIMIT, reason="ESTOP_PRESSED")
    story.run("SERVOING", 1.0)
    story.run("FAILED", 1.0)
    (docking,) = dockings(story.close())
    assert docking["verdict"] == (
        "failed in SERVOING after 3.0 s: emergency stop (ESTOP_PRESSED) for 1.0 s from t=2.0 s"
    )
    assert [item["text"] for item in docking["causes"][1:]] == ["safety stop ESTOP_PRESSED for 1.0 s from t=2.0 s"]
    assert {(item["code"], item["from_s"], item["to_s"]) for item in docking["safety"]} == {
        ("ESTOP_PRESSED", 2.0, 3.0),
        ("emergency stop", 2.0, 3.0),
    }
    assert docking["limits"][0]["linear_mps"] == 0.0


def test_active_limit_and_fault_are_reported_from_start_of_docking(story):
    story.faults = ("IMU_TIMEOUT",)
    story.write(topics.VELOCITY_LIMIT, max_linear_velocity=0.5, reason="IMU_TIMEOUT")
    story.run("IDLE", 3.0)
    story.run("APPROACH", 2.0)
    story.run("IDLE", 1.0)
    (docking,) = dockings(story.close())
    assert docking["verdict"].startswith("ended in APPROACH after 2.0 s without failing")
    assert docking["limits"] == [
        {
            "value": None,
            "from_s": 0.0,
            "to_s": 2.0,
            "duration_s": 2.0,
            "linear_mps": 0.5,
            "angular_radps": 0.0,
            "reason": "IMU_TIMEOUT",
        }
    ]
    assert docking["safety"][0]["from_s"] == 0.0


def test_replay_lists_messages_of_other_nodes_during_docking(story):
    story.run("IDLE", 0.5)
    story.run("SERVOING", 1.0)
    words = make("diagnostic_msgs/msg/DiagnosticStatus", name="docking_controller", message="MARKERS_LOST")
    story.write(topics.DIAGNOSTICS, status=[words])
    story.run("FAILED", 0.5)
    story.write(topics.MISSION_STATUS, reason="docking failed")
    story.run("FAILED", 2.0)
    story.write(topics.MISSION_STATUS, reason="much later")
    (docking,) = dockings(story.close())
    assert [item["text"] for item in docking["log"]] == ["docking_controller: MARKERS_LOST", "mission: docking failed"]


def test_two_dockings_and_an_undocking(story):
    send(story, LOST_MARKERS)
    story.markers, story.error_m = 4, 1.0
    success(story)
    story.run("SERVOING", 3.0)  # backs off from the opened latch
    story.run("IDLE", 2.0)
    found = dockings(story.close())
    assert [item["success"] for item in found] == [False, True]
    assert found[1]["start_s"] - found[0]["start_s"] == pytest.approx(16.5, abs=0.05)


@pytest.mark.parametrize("share", [0.25, 0.4])
def test_truncated_recording_is_evaluated_up_to_damage(story, tmp_path, share):
    story.chunk_bytes = 5_000
    send(story, LOST_MARKERS)
    story.close()
    (file,) = story.folder.glob("*.mcap")
    os.truncate(file, int(share * file.stat().st_size))
    before = file.read_bytes()
    traces, damages = collect(recording_files(story.folder), PARAMS)
    assert len(traces) == 1
    assert traces[0].after == ""
    assert len(damages) == 1
    assert damages[0].startswith(f"{file} is cut off or damaged after ")
    assert file.read_bytes() == before, "nothing is repaired behind the operator's back"


def test_pictures_text_and_numbers(tmp_path, capsys):
    story = Story(tmp_path / "ride", images=True)
    send(story, LOST_MARKERS)
    replay_recording(story.close(), tmp_path / "pictures", tmp_path / "numbers.json")
    shown = capsys.readouterr().out
    assert "docking 1: chair_1, 2023-11-14 22:13:21 UTC, 14.0 s, 1 try" in shown
    assert "verdict: failed in SEARCH after 14.0 s: markers lost for 8.0 s from t=6.0 s" in shown
    assert "marker 3: 40 detections, quality median 0.90, least 0.90" in shown
    document = json.loads((tmp_path / "numbers.json").read_text())
    assert document["dockings"][0]["images"] == 6  # five states and the loss of the markers
    plot = cv2.imread(str(tmp_path / "pictures" / "docking_1.png"))
    assert min(plot.shape[:2]) > 1000
    images = cv2.imread(str(tmp_path / "pictures" / "docking_1_images.png"))
    assert images.shape[1] > 1200
    assert (images[..., 1].astype(int) - images[..., 0] > 80).any(), "green outlines"
    (trace,), _ = collect(recording_files(story.folder), PARAMS)
    figure = strip(trace, DOCKS.marker_size_m)
    assert len(figure.axes) == 6, "three rows of two"
    assert "no marker any more" in figure.axes[3].get_title(loc="left")
    shown = figure.axes[2].images[0].get_array()
    assert shown.shape == (720, 1280, 3)
    assert shown.mean() == pytest.approx(90.0, abs=1.0)
    # Marker 0 is 1 m straight ahead and 135 px wide around the image's centre.
    square = next(patch for patch in figure.axes[2].patches).get_xy()
    assert square.min(axis=0) == pytest.approx((639.5 - 67.5, 359.5 - 67.5), abs=4.0)
    assert square.max(axis=0) == pytest.approx((639.5 + 67.5, 359.5 + 67.5), abs=4.0)


def refusal(recording: Path, output: Path) -> str:
    with pytest.raises(CommandError) as caught:
        replay_recording(recording, output, None)
    return str(caught.value)


def test_what_is_no_recording(tmp_path):
    assert "cannot be read: No such file" in refusal(tmp_path / "nowhere", tmp_path / "out")
    (tmp_path / "empty").mkdir()
    assert "is no recording: there is no .mcap file in it" in refusal(tmp_path / "empty", tmp_path / "out")
    (tmp_path / "letter.mcap").write_text("Dear Sir or Madam")
    assert "does not begin as an MCAP file" in refusal(tmp_path / "letter.mcap", tmp_path / "out")


def test_no_docking_in_it(story, tmp_path):
    story.run("IDLE", 1.0)
    text = refusal(story.close(), tmp_path / "out")
    assert text == "there is no docking in the recording (10 messages on /docking/status)"


def test_an_output_that_cannot_be_written(story, tmp_path):
    send(story, LOST_MARKERS)
    assert "/proc/pictures cannot be written" in refusal(story.close(), Path("/proc/pictures"))
    (tmp_path / "file").touch()
    assert "cannot be written: File exists" in refusal(story.folder, tmp_path / "file")
