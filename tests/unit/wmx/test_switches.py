"""Limit switches: their effect on an axis that moves into one, and on others."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from robot_stack.core.config import ConfigError, validate
from robot_stack.wmx.api import (
    Config_LimitSwitchDirection,
    Config_LimitSwitchType,
    ErrorCode,
    Motion_PosCommand,
    OperationState,
    Profile,
    Velocity_VelCommand,
)
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.bus import DriveFeedback
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.simulated import __main__ as main
from robot_stack.wmx.simulated.parameter_file import read_file
from robot_stack.wmx.simulated.switches import DriveSwitches, drive_switches
from tests.unit.wmx.harness import POS, POS_MIRRORED, VEL, axis_kind, engine_config, engine_data
from tests.unit.wmx.machine import Machine

Type = Config_LimitSwitchType


def run_into(bench: Machine, axis: int, **limits: object) -> None:
    """Moves an axis at 1 rad/s into its switches at +-0.5 rad and runs 1500 cycles."""
    bench.switches(axis, positive_limit=0.5, negative_limit=-0.5)
    bench.limits(axis, **limits)
    assert bench.along(axis, 1.0) == 0
    bench.run(1500)


class TestActions:
    def test_none_only_reports(self, bench: Machine) -> None:
        run_into(bench, POS, lsType=Type.PyNone)
        assert bench.flag(Flag.POSITIVE_LS, POS) == 1
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Pos
        assert bench.velocity(POS) == pytest.approx(1.0)

    @pytest.mark.parametrize(
        ("kind", "dec", "servo_off"),
        [
            (Type.Dec, 10.0, False),
            (Type.SlowDec, 2.0, False),
            (Type.DecServoOff, 10.0, True),
            (Type.SlowDecServoOff, 2.0, True),
        ],
    )
    def test_decelerations(self, bench: Machine, kind: Type, dec: float, servo_off: bool) -> None:
        run_into(bench, POS, lsType=kind)
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Idle
        # v^2 / 2a beyond the switch, plus one or two cycles of the bus at 1 mm per cycle
        assert bench.position(POS) == pytest.approx(0.5 + 1.0 / (2.0 * dec), abs=0.004)
        assert bench.flag(Flag.SERVO_ON, POS) == (not servo_off)
        if not servo_off:
            assert bench.flag(Flag.END_REASON, POS) == ErrorCode.AxisHardLimit
        assert bench.flag(Flag.MOTION_COMPLETE, POS) == 0

    def test_servo_off(self, bench: Machine) -> None:
        run_into(bench, POS, lsType=Type.ServoOff)
        assert bench.flag(Flag.SERVO_ON, POS) == 0
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Idle
        assert 0.5 <= bench.position(POS) < 0.52, "the drive lets go a few cycles later"

    def test_other_axes_go_on(self, bench: Machine) -> None:
        assert bench.along(POS_MIRRORED, 1.0) == 0
        run_into(bench, POS, lsType=Type.Dec)
        assert bench.flag(Flag.OP_STATE, POS_MIRRORED) == OperationState.Pos

    def test_velocity_mode(self, bench: Machine) -> None:
        bench.switches(VEL, positive_limit=0.5)
        bench.limits(VEL, lsType=Type.Dec)
        command = Velocity_VelCommand(VEL, Profile.SetupTrapezoidal(1.0, 10.0, 10.0))
        assert bench.engine.motion.start_velocity(0, [command]) == 0
        bench.run(1000)
        assert bench.flag(Flag.OP_STATE, VEL) == OperationState.Idle
        assert bench.position(VEL) == pytest.approx(0.55, abs=0.004)
        assert bench.engine.motion.start_velocity(0, [command]) == ErrorCode.AxisHardLimit

    def test_a_stop_under_way_keeps_its_rate(self, bench: Machine) -> None:
        bench.switches(POS, positive_limit=0.5)
        bench.limits(POS, lsType=Type.Dec)
        assert bench.along(POS, 1.0) == 0
        bench.until(lambda: bench.position(POS) > 0.49, "close to the switch")
        bench.soft_stop(POS, 5.0)
        start = bench.position(POS)
        bench.rest(POS)
        assert bench.position(POS) - start == pytest.approx(0.1, abs=0.004)
        assert bench.flag(Flag.POSITIVE_LS, POS) == 1

    def test_a_stop_under_way_into_servo_off(self, bench: Machine) -> None:
        bench.switches(POS, positive_limit=0.5)
        bench.limits(POS, lsType=Type.ServoOff)
        assert bench.along(POS, 1.0) == 0
        bench.until(lambda: bench.position(POS) > 0.49, "close to the switch")
        bench.soft_stop(POS, 1.0)
        bench.until(lambda: not bench.flag(Flag.SERVO_ON, POS), "servo off")
        assert bench.position(POS) < 0.52


class TestDirections:
    def test_moving_away_is_free_and_moving_in_is_refused(self, bench: Machine) -> None:
        run_into(bench, POS, lsType=Type.Dec)
        assert bench.along(POS, 0.5) == ErrorCode.AxisHardLimit
        assert bench.move(POS, 2.0) == ErrorCode.AxisHardLimit
        assert bench.move(POS, 0.2) == 0
        bench.rest(POS)
        assert bench.position(POS) == pytest.approx(0.2, abs=1e-3)
        assert bench.flag(Flag.POSITIVE_LS, POS) == 0
        assert bench.move(POS, 0.3) == 0

    def test_all_axes_of_a_command_or_none(self, bench: Machine) -> None:
        run_into(bench, POS, lsType=Type.Dec)
        profile = Profile.SetupTrapezoidal(1.0, 10.0, 10.0)
        both = [Motion_PosCommand(POS_MIRRORED, 1.0, profile), Motion_PosCommand(POS, 1.0, profile)]
        assert bench.engine.motion.start_position(0, both, relative=False) == ErrorCode.AxisHardLimit
        assert bench.flag(Flag.OP_STATE, POS_MIRRORED) == OperationState.Idle

    def test_the_negative_end(self, bench: Machine) -> None:
        bench.switches(POS, positive_limit=0.5, negative_limit=-0.5)
        bench.limits(POS, lsType=Type.Dec)
        assert bench.along(POS, -1.0) == 0
        bench.run(1000)
        assert bench.position(POS) == pytest.approx(-0.55, abs=0.004)
        assert (bench.flag(Flag.POSITIVE_LS, POS), bench.flag(Flag.NEGATIVE_LS, POS)) == (0, 1)
        assert bench.along(POS, -1.0) == ErrorCode.AxisHardLimit
        assert bench.along(POS, 1.0) == 0

    def test_each_end_has_its_type(self, bench: Machine) -> None:
        run_into(
            bench,
            POS,
            lsType=Type.SeparatePositiveLSNegativeLS,
            positiveLSType=Type.PyNone,
            negativeLSType=Type.Dec,
        )
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Pos, "the positive end only reports"
        assert bench.along(POS, -1.0) == 0
        bench.rest(POS)
        assert bench.position(POS) < -0.5

    def test_reversed(self, bench: Machine) -> None:
        """On a mirrored axis the drive's positive end is the axis's negative one."""
        bench.switches(POS_MIRRORED, positive_limit=0.5)
        bench.limits(POS_MIRRORED, lsType=Type.Dec, lsDirection=Config_LimitSwitchDirection.Reverse)
        start = bench.position(POS_MIRRORED)
        assert bench.along(POS_MIRRORED, -1.0) == 0
        bench.run(1000)
        assert bench.flag(Flag.POSITIVE_LS, POS_MIRRORED) == 1
        assert bench.position(POS_MIRRORED) - start == pytest.approx(-0.55, abs=0.004)
        assert bench.along(POS_MIRRORED, -1.0) == ErrorCode.AxisHardLimit
        assert bench.along(POS_MIRRORED, 1.0) == 0

    def test_inverted_switches_are_on_where_they_were_off(self, bench: Machine) -> None:
        bench.switches(POS, positive_limit=0.5, negative_limit=-0.5)
        bench.limits(POS, lsType=Type.Dec, invertPositiveLSPolarity=True, invertNegativeLSPolarity=True)
        bench.run(1)
        assert (bench.flag(Flag.POSITIVE_LS, POS), bench.flag(Flag.NEGATIVE_LS, POS)) == (1, 1)
        assert bench.along(POS, 1.0) == bench.along(POS, -1.0) == ErrorCode.AxisHardLimit

    def test_a_move_that_turns_round_into_the_switch(self, bench: Machine) -> None:
        run_into(bench, POS, lsType=Type.Dec)
        assert bench.along(POS, -0.5) == 0
        bench.until(lambda: bench.velocity(POS) <= -0.4, "on its way out")
        assert bench.flag(Flag.POSITIVE_LS, POS) == 1
        assert bench.along(POS, 0.5) == ErrorCode.AxisHardLimit, "no override into it either"
        assert bench.flag(Flag.OP_STATE, POS) == OperationState.Pos


class TestSoftLimitTypes:
    def test_each_end_has_its_type(self, bench: Machine) -> None:
        bench.limits(
            POS,
            softLimitType=Type.SeparatePositiveLSNegativeLS,
            positiveSoftLimitType=Type.SlowDec,
            negativeSoftLimitType=Type.PyNone,
            softLimitPositivePos=0.5,
            softLimitNegativePos=-0.5,
        )
        bench.flags[Flag.HOME_DONE, POS] = 1
        assert bench.along(POS, 1.0) == 0
        bench.rest(POS)
        assert bench.position(POS) == pytest.approx(0.5 + 1.0 / 4.0, abs=0.004)
        assert bench.along(POS, -1.0) == 0
        bench.run(2000)
        assert bench.position(POS) < -0.6, "no limit at this end"


class TestVirtualSwitches:
    def test_by_position(self) -> None:
        inp = DriveFeedback.zeros(1, 1)
        switches = DriveSwitches(positive_limit=100.0, negative_limit=-100.0, home_from=-10.0, home_to=10.0)
        seen = []
        for position in (-101.0, -100.0, -11.0, 0.0, 10.0, 99.0, 100.0):
            switches.fill(inp, 0, position)
            seen.append((bool(inp.negative_limit[0]), bool(inp.home_switch[0]), bool(inp.positive_limit[0])))
        nothing = (False, False, False)
        low, home, high = (True, False, False), (False, True, False), (False, False, True)
        assert seen == [low, low, nothing, home, home, nothing, high]
        assert inp.has_limit_switches[0]
        assert inp.has_home_switch[0]

    def test_from_the_configuration(self) -> None:
        where = {
            "positive_limit_rad": 1.0,
            "negative_limit_rad": None,
            "home_from_rad": -0.5,
            "home_to_rad": 0.5,
        }
        kinds = {"a": axis_kind(polarity=-1, switches=where), "b": axis_kind()}
        axes = [{"name": name, "kind": name} for name in kinds]
        first, second = drive_switches(engine_config(kinds=kinds, axes=axes))
        scale = 131072.0 / (2.0 * math.pi)
        assert first == DriveSwitches(scale, -math.inf, -0.5 * scale, 0.5 * scale)
        assert second is None

    def test_the_process_gives_them_to_its_drives(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """The parameter file of a configuration can be written without running a server."""
        where = dict.fromkeys(("positive_limit_rad", "negative_limit_rad", "home_from_rad", "home_to_rad"), 1.0) | {
            "negative_limit_rad": -1.0,
            "home_to_rad": 2.0,
        }
        data = engine_data(kinds={"a": axis_kind(switches=where)}, axes=[{"name": "a", "kind": "a"}])
        made = main._engine(validate(EngineConfig, data, "test"))
        made.start_engine()
        made.start_communication()
        for _ in range(20):
            made.cycle()
        assert made.feedback.has_home_switch[0]
        assert made.feedback.has_limit_switches[0]
        configuration, written = tmp_path / "engine.yaml", tmp_path / "parameters.xml"
        configuration.write_text(yaml.safe_dump(data), encoding="utf-8")
        arguments = ["engine", "--config", str(configuration), "--export-parameters"]
        monkeypatch.setattr("sys.argv", [*arguments, str(written)])
        assert main.main() == 0
        assert read_file(str(written), 1).of_axes[0][0] == made.parameters.get("feedback", 0).inPosWidth  # type: ignore[union-attr]
        monkeypatch.setattr("sys.argv", [*arguments, str(tmp_path / "no" / "folder.xml")])
        assert main.main() == 1
        assert "No such file" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"positive_limit_rad": -2.0, "negative_limit_rad": -1.0}, "negative_limit_rad must be below"),
            ({"home_from_rad": 1.0}, "must be given together"),
            ({"home_from_rad": 1.0, "home_to_rad": 1.0}, "home_from_rad must be below"),
        ],
    )
    def test_bad_positions(self, changes: dict[str, float], message: str) -> None:
        names = ("positive_limit_rad", "negative_limit_rad", "home_from_rad", "home_to_rad")
        kinds = {"a": axis_kind(switches={**dict.fromkeys(names), **changes})}
        with pytest.raises(ConfigError, match=message):
            validate(EngineConfig, engine_data(kinds=kinds, axes=[{"name": "a", "kind": "a"}]), "file.yaml")

    def test_two_decelerations_for_one_parameter(self) -> None:
        soft = {"negative_rad": -1.0, "positive_rad": 1.0, "dec_radps2": 5.0}
        hard = {"action": "dec", "dec_radps2": 6.0, "slow_dec_radps2": 1.0}
        kinds = {"a": axis_kind(soft_limits=soft, limit_switches=hard)}
        with pytest.raises(ConfigError, match="must be equal"):
            validate(EngineConfig, engine_data(kinds=kinds, axes=[{"name": "a", "kind": "a"}]), "file.yaml")
