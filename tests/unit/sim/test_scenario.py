"""Scenario files, the figures of a run, and the rig."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_stack.core.config import ConfigError, config_dir, validate
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.drive.kinematics import ModuleSetPoints
from sim.plant.rig import Rig
from sim.plant.world import Setup
from sim.run.run_log import Moment, RunLog, motion_figures
from sim.run.scenario import Expectation, Scenario, load_named_scenario, load_scenario
from sim.worldfile import load_world

from .bench import PARAMS, ROBOT

SCENARIOS = sorted((config_dir() / "scenarios").glob("*.yaml"))
MINIMAL: dict[str, Any] = {"description": "test", "world": "flat", "seed": 1, "limit_s": 2.0}


def scenario(**more: Any) -> Scenario:
    return validate(Scenario, {**MINIMAL, **more}, "test.yaml")


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_is_valid_and_expects_something(path: Path) -> None:
    assert load_scenario(path).expect
    for event in load_scenario(path).events:
        assert event.describe()
    load_world(load_scenario(path).world)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"limit_s": 0}, "limit_s"),
        ({"twists": [{"at_s": 0, "vx_mps": math.nan}]}, "twists.0.vx_mps"),
        ({"mission": "a", "goals": [{"x_m": 1, "y_m": 0, "yaw_deg": 0}]}, "exclude each other"),
        ({"events": [{"at_s": 1}]}, "exactly one of fault"),
        ({"events": [{"at_s": 1, "estop": True, "reset": True}]}, "exactly one of fault"),
        ({"events": [{"at_s": 1, "estop": True, "value": 2}]}, "belong to a fault"),
        ({"expect": [{"figure": "distance_m"}]}, "one of above, below, equals"),
    ],
)
def test_a_wrong_scenario_is_refused_with_the_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError, match=field):
        scenario(**change)


@pytest.mark.parametrize(
    ("expectation", "problem"),
    [
        ({"figure": "speed", "above": 1.0}, None),
        ({"figure": "speed", "above": 2.0}, "speed must be above 2, is 2"),
        ({"figure": "speed", "below": 2.0}, "speed must be below 2, is 2"),
        ({"figure": "nan", "below": 2.0}, "nan must be below 2, is nan"),
        ({"figure": "state", "equals": "NORMAL"}, None),
        ({"figure": "state", "equals": "STOP"}, "state must be STOP, is NORMAL"),
        ({"figure": "state", "above": 1.0}, "state must be a number, is NORMAL"),
        ({"figure": "speeed", "above": 1.0}, "speeed: no such figure; there are nan, speed, state"),
    ],
)
def test_expectations(expectation: dict[str, Any], problem: str | None) -> None:
    figures = {"speed": 2.0, "state": "NORMAL", "nan": math.nan}
    assert validate(Expectation, expectation, "test").problem(figures) == problem


def moment(time_s: float, x_m: float, speed_mps: float) -> Moment:
    return Moment(time_s, Pose2(x_m, 0.0, 0.0), Twist2(speed_mps, 0.0, 0.0), (speed_mps,) * 4, (0.0,) * 4)


def test_figures_of_a_ride_by_hand() -> None:
    """1 m in 1 s at 1 m/s, an event, 0.25 m in 0.5 s to standstill; wheels commanded 1.0, then 0.5 m/s."""
    run_log = RunLog(
        moments=[moment(0.0, 0.0, 1.0), moment(1.0, 1.0, 1.0), moment(1.5, 1.25, 0.0), moment(2.0, 1.25, 0.0)]
    )
    run_log.commands = [(0.0, (1.0,) * 4, (0.0,) * 4), (1.5, (0.5,) * 4, (0.0,) * 4)]
    run_log.events = [(1.0, "estop True")]
    run_log.log_state(0.0, "NORMAL")
    run_log.log_state(0.5, "NORMAL")
    run_log.log_state(1.0, "EMERGENCY_STOP")
    run_log.estimates = [(1.0, Pose2(1.1, 0.0, 0.0)), (2.0, Pose2(1.25, 0.05, 0.0))]
    figures = motion_figures(run_log, Pose2(1.25, 0.3, math.pi))
    assert figures["distance_m"] == pytest.approx(1.25)
    assert figures["duration_s"] == 2.0
    assert figures["top_speed_mps"] == 1.0
    assert figures["stop_distance_m"] == pytest.approx(0.25)
    assert figures["stop_time_s"] == pytest.approx(0.5)
    assert figures["final_error_m"] == pytest.approx(0.3)
    assert figures["final_error_deg"] == pytest.approx(180.0)
    assert figures["wheel_speed_rms_error_mps"] == pytest.approx(math.sqrt(2 * 0.5**2 / 4))
    assert figures["safety_states"] == "NORMAL, EMERGENCY_STOP"
    assert figures["final_safety_state"] == "EMERGENCY_STOP"
    assert figures["estimate_error_max_m"] == pytest.approx(0.1)
    assert figures["estimate_error_final_m"] == pytest.approx(0.05)
    bare = motion_figures(RunLog(moments=run_log.moments[:2], events=run_log.events), None)
    assert bare["stop_distance_m"] == math.inf, "a robot that never stands"
    assert math.isnan(float(bare["wheel_speed_rms_error_mps"]))
    assert "estimate_error_max_m" not in bare
    with pytest.raises(ValueError, match="recorded no data"):
        motion_figures(RunLog(), None)


class Constant:
    """A controller with one constant set point."""

    def __init__(self, speed_mps: float, angle_rad: float) -> None:
        self._modules = ModuleSetPoints((speed_mps,) * 4, (angle_rad,) * 4)
        self.readings = 0
        self.commands = 0

    def observe(self, encoders: object) -> None:
        self.readings += 1

    def command(self, time_s: float) -> ModuleSetPoints:
        self.commands += 1
        return self._modules


def test_a_rig_takes_any_controller() -> None:
    file = load_world("flat")
    rig = Rig(ROBOT, PARAMS, Setup(file, 1, file.start.pose()))
    controller = Constant(0.0, 0.7)
    rig.run(0.5, controller, lambda modules: None)
    assert (controller.readings, controller.commands) == (25, 10)
    assert np.array(rig.moment().module_angles_rad) == pytest.approx([0.7] * 4, abs=0.01)
    rig.run(1.5, Constant(0.6, 0.7), lambda modules: None)
    twist = rig.moment().twist
    assert twist.vx == pytest.approx(0.6 * math.cos(0.7), abs=0.01)
    assert twist.vy == pytest.approx(0.6 * math.sin(0.7), abs=0.01)


def test_a_scenario_is_found_by_file_and_by_name(tmp_path: Path) -> None:
    by_name, name = load_named_scenario("bus_loss")
    assert name == "bus_loss"
    assert load_named_scenario(str(config_dir() / "scenarios" / "bus_loss.yaml")) == (by_name, "bus_loss")
    with pytest.raises(ConfigError, match=r"no scenario file 'nothing'.*known: bus_loss, emergency_stop_loaded"):
        load_named_scenario("nothing")
