"""The section safety_edge of robot.yaml: optional, and refused where it cannot work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.core.config import ConfigError, config_dir, read_yaml
from robot_stack.core.robot import CREEP_SPEED_MPS, EDGE_REACTION_S, SIDES, Robot, load_robot


def changed(folder: Path, monkeypatch: pytest.MonkeyPatch, **changes: Any) -> Robot:
    """The robot with another safety edge; remove=True: without one."""
    data = read_yaml(config_dir() / "robot.yaml")
    if changes.pop("remove", False):
        del data["safety_edge"]
    else:
        data["safety_edge"] |= changes
    (folder / "robot.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    return load_robot()


def test_shipped_edge_stops_the_robot_within_its_travel() -> None:
    robot = load_robot()
    edge = robot.safety_edge
    assert edge is not None
    ramp_m = CREEP_SPEED_MPS**2 / (2.0 * robot.emergency_deceleration_mps2)
    way_m = edge.trigger_m + CREEP_SPEED_MPS * EDGE_REACTION_S + ramp_m
    assert edge.stopping_way_m(robot.emergency_deceleration_mps2) == pytest.approx(way_m) == pytest.approx(0.0575)
    assert edge.travel_m > way_m
    assert tuple(edge.side_bits) == SIDES
    assert edge.stiffness_n_per_m * edge.trigger_m < 30.0


def test_a_robot_without_an_edge_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert changed(tmp_path, monkeypatch, remove=True).safety_edge is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rear_input_bit": 0}, "safety_edge.rear_input_bit 0 of byte 1 is safety_edge.front_input_bit too"),
        ({"relay_input_bit": 3}, "safety_edge.relay_input_bit 3 of byte 1 is safety_edge.right_input_bit too"),
        ({"byte": 0}, "front_input_bit 0 of byte 0 is estop_input_bit too"),
        (
            {"byte": 0, "front_input_bit": 5, "rear_input_bit": 2, "left_input_bit": 6},
            "rear_input_bit 2 of byte 0 is latch.open_input_bit too",
        ),
        ({"byte": 0, "front_input_bit": 7, "rear_input_bit": 6, "left_input_bit": 5}, None),
        ({"front_input_bit": 8}, "front_input_bit"),
        ({"byte": -1}, "byte"),
        ({"travel_m": 0.0574}, "travel_m must exceed the stopping way from 0.3 m/s"),
        ({"travel_m": 0.058}, None),
        ({"trigger_m": 0.01}, "travel_m must exceed the stopping way from 0.3 m/s"),
        ({"travel_m": 0.27}, "must be less than half of chassis and footprint"),
        ({"trigger_m": 0.0}, "trigger_m"),
        ({"stiffness_n_per_m": -1.0}, "stiffness_n_per_m"),
    ],
)
def test_an_edge_that_cannot_work_is_refused_by_name(
    changes: dict[str, Any], message: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if message is None:
        assert changed(tmp_path, monkeypatch, **changes).safety_edge is not None
        return
    with pytest.raises(ConfigError, match=message):
        changed(tmp_path, monkeypatch, **changes)
