"""The engine's configuration files: those of the robot are valid, invalid ones are rejected by name."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.core.config import ConfigError, config_dir, read_yaml, validate
from robot_stack.wmx.config import (
    ClientConfig,
    EngineConfig,
    load_client_config,
    load_engine_config,
    read_engine_config,
)
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.parameter_layout import AXIS_ENTRIES, ESTOP_DEC, GLOBAL_ENTRIES
from tests.unit.wmx.harness import axis_kind, client_config, engine_data, runtime_folder

SHIPPED = config_dir()


class TestRobotsEngine:
    def test_axes_follow_the_robots_numbers(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        robot = read_yaml(config_dir() / "robot.yaml")
        robot["axes"]["rr_steer"]["number"] = 9
        (tmp_path / "robot.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
        monkeypatch.setenv("ROBOT_STACK_CONFIG", str(tmp_path))
        config = read_engine_config(SHIPPED / "wmx_engine.yaml")
        assert config.cycle_time_s == 0.001
        names = [axis.name for axis in config.axes]
        assert names[:4] == ["fl_drive", "fl_steer", "fr_drive", "fr_steer"]
        assert names[6:] == ["rr_drive", "axis7", "axis8", "rr_steer"]

    def test_it_starts_with_the_vendors_defaults(self) -> None:
        """The robot's values come by import alone: gear 1:1, 100000 counts/s2, no input that stops the engine."""
        config = load_engine_config()
        engine = Engine(config, VirtualDrives(8, config.cycle_time_s))
        of_engine, of_axes = engine.parameter_set.collect()
        assert of_engine == list(GLOBAL_ENTRIES.values())
        assert of_axes == [list(AXIS_ENTRIES.values())] * 8
        assert AXIS_ENTRIES[ESTOP_DEC] == 100000.0
        assert not engine.parameters.emergency_stop.enableEStopSignal

    def test_client(self) -> None:
        config = load_client_config()
        assert config.engine == "simulated"
        assert config.status_stale_s <= 0.1, "older than this, joint states would be stale"
        assert not config.bridged

    def test_bridge_replaces_the_vendors_module_and_nothing_else(self) -> None:
        data = {**load_client_config().model_dump(), "bridge": "/run/wmx_bridge"}
        simulated, vendor = (validate(ClientConfig, {**data, "engine": one}, "test") for one in ("simulated", "vendor"))
        assert (simulated.bridged, simulated.device_path) == (False, "")
        assert (vendor.bridged, vendor.device_path) == (True, "/run/wmx_bridge")
        with pytest.raises(ConfigError, match="or bridge a folder"):
            validate(ClientConfig, {**data, "engine": "vendor", "bridge": ""}, "test")


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
@pytest.mark.parametrize("value", [0.0, math.inf])
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
