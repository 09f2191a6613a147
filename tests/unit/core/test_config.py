"""Configuration files: an error is reported in one line that names file and field."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
from pydantic import Field

from robot_stack.core.config import Config, ConfigError, config_dir, load, read_yaml, validate
from robot_stack.core.robot import Robot, load_robot


class Example(Config):
    speed_mps: Annotated[float, Field(gt=0.0, le=2.0)]
    name: str


def test_the_robot_of_the_repository_loads() -> None:
    robot = load_robot()
    assert robot.module_positions_m() == ((0.3, 0.25), (0.3, -0.25), (-0.3, 0.25), (-0.3, -0.25))
    assert robot.motion(passenger_attached=True).max_speed_mps == 1.0
    assert robot.motion(passenger_attached=False).max_speed_mps == 1.5


def test_a_passenger_never_rides_faster() -> None:
    data = load_robot().model_dump()
    data["with_passenger"]["max_speed_mps"] = 9.0
    with pytest.raises(ConfigError, match=r"with_passenger.max_speed_mps must not exceed"):
        validate(Robot, data, "robot.yaml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{speed_mps: 1.0}", "name: is missing"),
        ("{speed_mps: 1.0, name: a, sped: 2}", "sped: is not a known parameter"),
        ("{speed_mps: .nan, name: a}", "speed_mps"),
        ("{speed_mps: fast, name: a}", "speed_mps"),
        ("[1, 2]", "must be a mapping"),
        ("{speed_mps: 1.0", "not valid YAML"),
    ],
)
def test_bad_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, words: str) -> None:
    (tmp_path / "robot.yaml").write_text("{}")
    (tmp_path / "example.yaml").write_text(text)
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
    with pytest.raises(ConfigError) as caught:
        load(Example, "example")
    assert words in str(caught.value)
    assert "example.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_overrides_win_and_are_validated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot.yaml").write_text("{}")
    (tmp_path / "example.yaml").write_text("{speed_mps: 1.0, name: a}")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
    assert load(Example, "example", {"speed_mps": 0.5}).speed_mps == 0.5
    with pytest.raises(ConfigError, match="speed_mps"):
        load(Example, "example", {"speed_mps": -0.5})


def test_missing_file_and_missing_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_yaml(tmp_path / "none.yaml")
    (tmp_path / "x.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not UTF-8"):
        read_yaml(tmp_path / "x.yaml")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
    with pytest.raises(ConfigError, match=r"no configuration folder"):
        config_dir()
