"""The engine's configuration files: those of the robot are valid, invalid ones are rejected by name."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.core.robot import load_robot
from robot_stack.wmx.api import AxisCommandMode, Config_EStopSignalSource, EStopLevel
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.config import (
    ClientConfig,
    EngineConfig,
    load_client_config,
    load_engine_config,
    read_engine_config,
)
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from tests.unit.wmx.harness import axis_kind, client_config, engine_data, runtime_folder


class TestRobotsEngine:
    def test_axes_are_the_robots_joints_in_order(self) -> None:
        config = load_engine_config()
        corners = ("fl", "fr", "rl", "rr")
        assert [axis.name for axis in config.axes] == [f"{c}_{j}" for c in corners for j in ("drive", "steer")]
        modes = [config.axis_kind(axis).mode for axis in range(8)]
        assert modes == ["velocity", "position"] * 4

    def test_gear_ratios_are_the_robots_encoders(self) -> None:
        config, robot = load_engine_config(), load_robot()
        for axis in range(8):
            encoder = (robot.drive if axis % 2 == 0 else robot.steer).encoder_counts_per_rev
            assert config.axis_kind(axis).counts_per_rad == pytest.approx(encoder / (2.0 * math.pi))

    def test_emergency_deceleration_is_the_robots(self) -> None:
        config, robot = load_engine_config(), load_robot()
        at_the_wheel = robot.emergency_deceleration_mps2 / robot.wheel_radius_m
        assert config.kinds["drive"].estop_dec_radps2 == pytest.approx(at_the_wheel, rel=1e-4)
        assert config.kinds["drive"].quick_stop_dec_radps2 == pytest.approx(at_the_wheel, rel=1e-4)
        assert config.kinds["steer"].estop_dec_radps2 <= robot.steer.max_acceleration_radps2

    def test_relay_of_the_safety_edge_stops_the_engine(self) -> None:
        signal, edge = load_engine_config().estop_signal, load_robot().safety_edge
        assert edge is not None
        assert (signal.enabled, signal.byte, signal.bit) == (True, edge.byte, edge.relay_input_bit)
        assert (signal.active, signal.level) == (0, "level1"), "normally closed"

    def test_a_robot_without_an_edge_has_no_input_that_stops_the_engine(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        robot = read_yaml(config_dir() / "robot.yaml")
        del robot["safety_edge"]
        (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
        (tmp_path / "wmx_engine.yaml").write_text((config_dir() / "wmx_engine.yaml").read_text(encoding="utf-8"))
        monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
        assert not load_engine_config().estop_signal.enabled

    def test_another_input_of_the_robot_is_refused(self, tmp_path: Path) -> None:
        text = (config_dir() / "wmx_engine.yaml").read_text(encoding="utf-8")
        file = tmp_path / "engine.yaml"
        file.write_text(text.replace("robot_input: safety_edge", "robot_input: bumper"), encoding="utf-8")
        with pytest.raises(ConfigError, match="robot_input must be safety_edge, is 'bumper'"):
            read_engine_config(file)

    def test_cycle_is_a_millisecond(self) -> None:
        assert load_engine_config().cycle_time_s == 0.001

    def test_engine_takes_it_over(self) -> None:
        config = load_engine_config()
        engine = Engine(config, VirtualDrives(8, config.cycle_time_s))
        modes = [AxisCommandMode.Velocity, AxisCommandMode.Position] * 4
        assert engine.arrays.flags[Flag.COMMAND_MODE].tolist() == modes
        stop = engine.parameters.emergency_stop
        assert stop.eStopDec[0] == pytest.approx(2.0 / 0.0825)
        assert stop.eStopSignalSource == Config_EStopSignalSource.Input
        assert stop.eStopSignalLevel == EStopLevel.Level1

    def test_client(self) -> None:
        config = load_client_config()
        assert config.engine == "simulated"
        assert config.status_stale_s <= 0.1, "older than this, joint states would be stale"


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no axes": ({"axes": []}, "axes"),
    "too many axes": ({"axes": [{"name": str(n), "kind": "pos"} for n in range(129)]}, "axes"),
    "unknown kind": ({"axes": [{"name": "a", "kind": "wheel"}]}, "axes.0.kind: 'wheel' is none of"),
    "same name twice": ({"axes": [{"name": "a", "kind": "pos"}] * 2}, "names must differ"),
    "cycle of zero": ({"cycle_time_s": 0.0}, "cycle_time_s"),
    "cycle of a second": ({"cycle_time_s": 1.0}, "cycle_time_s"),
    "cycle NaN": ({"cycle_time_s": math.nan}, "cycle_time_s"),
    "inputs": ({"n_input_bytes": 8001}, "n_input_bytes"),
    "unknown key": ({"speed": 1.0}, "speed: is not a known parameter"),
    "button beyond the inputs": (
        {"estop_signal": {"enabled": True, "byte": 4, "bit": 0, "active": 0, "level": "level1"}},
        "estop_signal.byte must be below n_input_bytes",
    ),
    "button's bit": (
        {"estop_signal": {"enabled": True, "byte": 0, "bit": 8, "active": 0, "level": "level1"}},
        "estop_signal.bit",
    ),
    **{
        f"{field} {value}": (
            {"kinds": {"pos": axis_kind(**{field: value})}, "axes": [{"name": "a", "kind": "pos"}]},
            field,
        )
        for field, value in (
            ("gear_numerator", 0.0),
            ("gear_denominator", math.inf),
            ("gear_denominator", -1.0),
            ("polarity", 0),
            ("mode", "torque"),
            ("estop_dec_radps2", 0.0),
            ("quick_stop_dec_radps2", -1.0),
            ("quick_stop_dec_radps2", math.nan),
            ("in_pos_width_rad", 0.0),
            ("soft_limits", {"negative_rad": 1.0, "positive_rad": -1.0, "dec_radps2": 1.0}),
        )
    },
}


@pytest.mark.parametrize(("changes", "message"), list(BAD.values()), ids=list(BAD))
def test_bad_engine_configuration(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as raised:
        validate(EngineConfig, {**engine_data(), **changes}, "file.yaml")
    assert str(raised.value).startswith("file.yaml: ")


@pytest.mark.parametrize("field", ["call_timeout_s", "status_stale_s", "connect_timeout_s", "lock_retry_s"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "soon"])
def test_bad_client_configuration(field: str, value: Any) -> None:
    with runtime_folder() as folder:
        data = client_config(folder).model_dump()
    with pytest.raises(ConfigError, match=field):
        validate(ClientConfig, {**data, field: value}, "file.yaml")


def test_soft_limits_reach_the_engine() -> None:
    kinds = {"pos": axis_kind(soft_limits={"negative_rad": -1.0, "positive_rad": 2.0, "dec_radps2": 5.0})}
    config = validate(EngineConfig, engine_data(kinds=kinds, axes=[{"name": "a", "kind": "pos"}]), "test")
    engine = Engine(config, VirtualDrives(1, 0.001))
    limit = engine.parameters.get("limit", 0)
    assert limit.softLimitPositivePos == 2.0  # type: ignore[union-attr]
    assert limit.softLimitNegativePos == -1.0  # type: ignore[union-attr]


def test_two_decelerations_for_one_parameter() -> None:
    soft = {"negative_rad": -1.0, "positive_rad": 1.0, "dec_radps2": 5.0}
    hard = {"action": "dec", "dec_radps2": 6.0, "slow_dec_radps2": 1.0}
    kinds = {"a": axis_kind(soft_limits=soft, limit_switches=hard)}
    with pytest.raises(ConfigError, match="must be equal"):
        validate(EngineConfig, engine_data(kinds=kinds, axes=[{"name": "a", "kind": "a"}]), "file.yaml")
