"""Parameters as services, on a real engine in a thread."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import Motion_JogCommand, Profile
from robot_stack.wmx.services.parameter_sets import load_file, show
from tests.unit.wmx.harness import N_AXES, POS, POS_GEARED, VEL_MIRRORED, Harness


@pytest.fixture
def engine(harness: Harness) -> Iterator[MotionEngine]:
    yield harness.ready()
    harness.end_test()


def test_parameters_of_an_axis_are_shown_line_by_line(engine: MotionEngine) -> None:
    read = show(engine, [VEL_MIRRORED, POS_GEARED])
    assert (read.answer.success, read.answer.message) == (True, "Parameters of axis 3; Parameters of axis 4; ")
    mirrored, geared = (text.splitlines() for text in read.texts)
    assert mirrored[:4] == ["axis: 3", "gear ratio: 131072 / 6.28318530718", "polarity: -1", "command mode: Velocity"]
    assert geared[:4] == ["axis: 4", "gear ratio: 52953088 / 6.28318530718", "polarity: 1", "command mode: Position"]
    assert "motion.quickStopDec: 200.0" in geared
    assert "limit.softLimitType: PyNone" in geared, "enumerations by their names"


def test_no_index_means_every_axis(engine: MotionEngine) -> None:
    assert [text.splitlines()[0] for text in show(engine, []).texts] == [f"axis: {axis}" for axis in range(N_AXES)]


@pytest.mark.parametrize("axis", [-1, N_AXES, 128])
def test_unknown_axis_is_named_and_the_others_are_shown(engine: MotionEngine, axis: int) -> None:
    read = show(engine, [axis, 0])
    failed = f"Failed to get gear ratio of axis {axis}. Error=1547 (the axis number is out of range); "
    assert (read.answer.success, read.answer.message) == (False, failed + "Parameters of axis 0; ")
    assert (read.texts[0], read.texts[1][:7]) == ("", "axis: 0")


def test_exported_file_is_loaded_again(engine: MotionEngine, tmp_path: Path) -> None:
    path = str(tmp_path / "all.xml")
    assert engine.core_motion.config.GetAndExportAll(path) == 0
    before = show(engine, []).texts
    assert engine.core_motion.config.SetAxisPolarity(POS, -1) == 0
    answer = load_file(engine, path)
    assert (answer.success, answer.message) == (True, f"Loaded parameters from {path}")
    assert show(engine, []).texts == before


def test_files_that_are_none_are_refused(engine: MotionEngine, tmp_path: Path) -> None:
    missing = tmp_path / "missing.xml"
    assert load_file(engine, str(missing)).message.startswith(
        f"Failed to load parameters from '{missing}'. Error=1562 ("
    )
    broken = tmp_path / "broken.xml"
    broken.write_text("no XML", encoding="ascii")
    assert "Error=65542 (" in load_file(engine, str(broken)).message
    for path in ("", "relative.xml"):
        answer = load_file(engine, path)
        assert (answer.success, "file_path must be absolute" in answer.message) == (False, True)


def test_nothing_is_loaded_under_a_moving_axis(engine: MotionEngine, tmp_path: Path) -> None:
    path = str(tmp_path / "all.xml")
    assert engine.core_motion.config.GetAndExportAll(path) == 0
    assert engine.core_motion.motion.StartJog(Motion_JogCommand(POS, Profile.SetupTrapezoidal(1.0, 5.0, 5.0))) == 0
    answer = load_file(engine, path)
    assert (answer.success, answer.message) == (
        False,
        f"Failed to load parameters from '{path}': axes {POS} are moving",
    )


def test_engine_that_was_stopped_is_named(engine: MotionEngine) -> None:
    assert engine.api.StopEngine(20000) == 0
    assert not load_file(engine, "/p.xml").success
    assert "Error=" in load_file(engine, "/p.xml").message
    assert "Error=" in show(engine, []).answer.message
