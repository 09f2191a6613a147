"""The parameter file: what is read, what is rejected and why, and that nothing is set partially."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.core.config import config_dir, load
from robot_stack.wmx.api import (
    AxisCommandMode,
    Config_HomeType,
    Config_LimitSwitchType,
    CoreMotionErrorCode,
    ErrorCode,
)
from robot_stack.wmx.axes import Flag, Real
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.parameter_file import (
    LARGEST_FILE,
    ParameterFileError,
    ParameterValues,
    number_text,
    parse,
    read_file,
    render,
    write_file,
)
from robot_stack.wmx.simulated.parameter_layout import AXIS_ENTRIES, GLOBAL_ENTRIES
from tests.unit.wmx.harness import N_AXES, POS, POS_MIRRORED, engine_config

INVALID = CoreMotionErrorCode.ParameterSettingsInvalid
AXIS = list(AXIS_ENTRIES)
WHOLE = list(GLOBAL_ENTRIES)


def small(block: str = "", axis: str = "0", head: str = "") -> bytes:
    """Returns a file of one axis with one section."""
    inner = f'<AxisParameters Axis="{axis}">{block}</AxisParameters>'
    return f"{head}<Parameters><GlobalParameters/>{inner}</Parameters>".encode()


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine(engine_config(), VirtualDrives(N_AXES, 0.001))


@pytest.fixture
def fresh(engine: Engine) -> Engine:
    """Returns an engine with its configuration's parameters, communicating, servos on."""
    engine.stop_engine()
    for _ in range(20):
        engine.cycle()
    engine.start_engine()
    engine.start_communication()
    for _ in range(30):
        engine.cycle()
    assert engine.set_servo_on(range(N_AXES), 1) == 0
    for _ in range(30):
        engine.cycle()
    assert engine.arrays.flags[Flag.SERVO_ON].all()
    return engine


def values(engine: Engine) -> ParameterValues:
    return ParameterValues(*engine.parameter_set.collect())


def changed(engine: Engine, axis: int | None, key: str, value: Any) -> ParameterValues:
    """Returns the engine's parameters with one number changed; ``axis`` None stands for the engine as a whole."""
    present = values(engine)
    if axis is None:
        present.of_engine[WHOLE.index(key)] = value
    else:
        present.of_axes[axis][AXIS.index(key)] = value
    return present


def apply(engine: Engine, wanted: ParameterValues) -> int:
    return engine.parameter_set.apply(wanted.of_engine, wanted.of_axes, engine.condition.communicating)


class TestText:
    @given(st.floats(allow_nan=False, allow_infinity=False))
    def test_every_float_survives(self, number: float) -> None:
        assert float(number_text(number, 0.0)) == number

    def test_the_text_has_a_block_for_each_of_the_vendors_axes(self) -> None:
        text = render(ParameterValues(list(GLOBAL_ENTRIES.values()), []))
        assert text.count("<AxisParameters Axis=") == 128
        assert '\t<AxisParameters Axis="127">\n\t\t<FeedbackParam>\n\t\t\t<InPosWidth>1000.000000</InPosWidth>' in text
        assert "\t\t\t\t<proportionalGain>0.000000</proportionalGain>" in text
        assert parse(text.encode(), 128).of_axes[127] == list(AXIS_ENTRIES.values())

    def test_numbers_are_written_as_the_vendor_does(self) -> None:
        axis = dict(AXIS_ENTRIES)
        axis["AxisParam/AxisGearRatioDenominator"] = 2 * math.pi
        axis["AxisParam/AxisGearRatioNumerator"] = 52953088.0
        axis["AxisParam/AxisPolarity"] = -1
        text = render(ParameterValues(list(GLOBAL_ENTRIES.values()), [list(axis.values())]))
        assert "<AxisGearRatioDenominator>6.283185307179586<" in text
        assert "<AxisGearRatioNumerator>52953088.000000<" in text
        assert "<AxisPolarity>-1<" in text

    def test_a_missing_entry_is_zero_and_a_missing_axis_all_zeros(self) -> None:
        read = parse(small("<MotionParam><QuickStopDec>7.5</QuickStopDec></MotionParam>"), 2)
        assert read.of_axes[0][AXIS.index("MotionParam/QuickStopDec")] == 7.5
        assert sum(1 for number in read.of_axes[0] if number) == 1
        assert read.of_axes[1] == [0] * len(AXIS)
        assert read.of_engine == [0] * len(WHOLE)

    def test_unknown_entries_and_further_axes_are_passed_over(self) -> None:
        text = small("<MotionParam><NewThing>9</NewThing><QuickStopDec>7</QuickStopDec></MotionParam>", axis="3")
        assert parse(text, 2).of_axes == [[0] * len(AXIS)] * 2
        assert parse(text, 4).of_axes[3][AXIS.index("MotionParam/QuickStopDec")] == 7

    @pytest.mark.parametrize(
        "text",
        [
            b"",
            b"<Parameters>",
            b"<Settings><GlobalParameters/></Settings>",
            b"<Parameters/>",
            b"<Parameters><GlobalParameters/><GlobalParameters/></Parameters>",
            b"\xff\xfe\x00",
            b"\x00" * 40,
            small(axis="128"),
            small(axis="-1"),
            small(axis=""),
            small(axis="1.0"),
            small(axis="\u00b2"),
            b'<Parameters><AxisParameters Axis="0"/><AxisParameters Axis="0"/></Parameters>',
            small("<MotionParam><QuickStopDec>fast</QuickStopDec></MotionParam>"),
            small("<MotionParam><QuickStopDec></QuickStopDec></MotionParam>"),
            small("<MotionParam><QuickStopDec>nan</QuickStopDec></MotionParam>"),
            small("<MotionParam><QuickStopDec>1_000</QuickStopDec></MotionParam>"),
            small("<MotionParam><QuickStopDec>0x10</QuickStopDec></MotionParam>"),
            small("<MotionParam><QuickStopDec>1</QuickStopDec><QuickStopDec>2</QuickStopDec></MotionParam>"),
            small(
                "<MotionParam><QuickStopDec>&more;</QuickStopDec></MotionParam>",
                head='<!DOCTYPE p [<!ENTITY more "1">]>',
            ),
            small("<a>" * 40 + "1" + "</a>" * 40),
            small("<MotionParam><QuickStopDec>" + "9" * 1000 + "</QuickStopDec></MotionParam>"),
        ],
    )
    def test_malformed_parameter_file_is_rejected(self, text: bytes) -> None:
        with pytest.raises(ParameterFileError):
            parse(text, 1)
        with pytest.raises(ParameterFileError, match="bytes"):
            parse(b" " * (LARGEST_FILE + 1), 1)

    @given(st.binary(max_size=200))
    def test_no_bytes_do_anything_else(self, data: bytes) -> None:
        with pytest.raises(ParameterFileError):
            parse(data, 1)


class TestFile:
    def test_a_folder_that_is_missing(self, tmp_path: Path) -> None:
        with pytest.raises(OSError, match="missing"):
            write_file(str(tmp_path / "missing" / "p.xml"), ParameterValues(list(GLOBAL_ENTRIES.values()), []))

    def test_a_target_that_is_a_folder_leaves_nothing_behind(self, tmp_path: Path) -> None:
        target = tmp_path / "folder"
        target.mkdir()
        with pytest.raises(OSError, match="folder"):
            write_file(str(target), ParameterValues(list(GLOBAL_ENTRIES.values()), []))
        assert list(tmp_path.iterdir()) == [target]

    @pytest.mark.parametrize("make", [lambda path: None, lambda path: path.mkdir(), lambda path: os.mkfifo(path)])
    def test_missing_or_unreadable_parameter_file_raises_os_error(
        self, tmp_path: Path, make: Callable[[Path], None]
    ) -> None:
        path = tmp_path / "p.xml"
        make(path)
        with pytest.raises(OSError, match=r"p\.xml"):
            read_file(str(path), 1)

    def test_a_path_with_a_zero_byte(self) -> None:
        with pytest.raises(ValueError, match="null"):
            read_file("a\0b", 1)


class TestSet:
    def test_every_honoured_block_is_set(self, fresh: Engine) -> None:
        wanted = changed(fresh, POS, "FeedbackParam/InPosWidth", 0.25)
        axis = wanted.of_axes[POS]
        for key, value in {
            "HomeParam/HomeType": int(Config_HomeType.HS),
            "HomeParam/HomingVelFast": 3.0,
            "HomeParam/ClearHomeDoneOnServoOff": 1,
            "LimitParam/LSType": int(Config_LimitSwitchType.Dec),
            "MotionParam/QuickStopDec": 17.0,
            "AlarmParam/FollowingErrorMoving": 0.5,
            "EmergencyStopParam/EStopDec": 19.0,
            "SyncParam/SyncGain": 1.5,
        }.items():
            axis[AXIS.index(key)] = value
        assert apply(fresh, wanted) == 0
        parameters = fresh.parameters
        assert parameters.get("feedback", POS).inPosWidth == 0.25  # type: ignore[union-attr]
        home = parameters.home(POS)
        assert (home.homeType, home.homingVelocityFast, home.clearHomeDoneOnServoOff) == (2, 3.0, True)
        assert parameters.get("limit", POS).lsType == 3  # type: ignore[union-attr]
        assert parameters.get("motion", POS).quickStopDec == 17.0  # type: ignore[union-attr]
        assert parameters.get("alarm", POS).followingErrorMoving == 0.5  # type: ignore[union-attr]
        assert parameters.emergency_stop.eStopDec[POS] == 19.0
        assert values(fresh) == wanted

    def test_restarting_the_engine_forgets_the_file(self, fresh: Engine) -> None:
        before = values(fresh)
        assert apply(fresh, changed(fresh, POS, "SyncParam/SyncGain", 1.5)) == 0
        fresh.stop_engine()
        assert values(fresh) == before

    @pytest.mark.parametrize(
        ("axis", "key", "value"),
        [
            (POS, "MotionParam/QuickStopDec", 0.0),
            (POS, "MotionParam/QuickStopDec", -1.0),
            (POS, "MotionParam/QuickStopDec", math.nan),
            (POS, "MotionParam/QuickStopDec", math.inf),
            (POS, "MotionParam/QuickStopDec", 3e11),
            (POS, "MotionParam/ProhibitOvertravel", 3),
            (POS, "MotionParam/InterruptedIntplUseQuickStop", 2),
            (POS, "AxisParam/AxisGearRatioNumerator", 0.0),
            (POS, "AxisParam/AxisGearRatioDenominator", 1e-7),
            (POS, "AxisParam/AxisPolarity", 0),
            (POS, "AxisParam/AxisCommandMode", int(AxisCommandMode.Torque)),
            (POS, "AxisParam/AbsoluteEncoderMode", 2),
            (POS, "AxisParam/AbsoluteEncoderHomeOffset", 1e17),
            (POS, "HomeParam/HomeType", 21),
            (POS, "HomeParam/HomeType", 0.5),
            (POS, "HomeParam/HomeDir", 2),
            (POS, "HomeParam/HomingVelSlow", 0.0),
            (POS, "HomeParam/HomeShiftDec", 0.0),
            (POS, "HomeParam/MaxLSReverseDistance", -1.0),
            (POS, "HomeParam/InvertHSPolarity", 2),
            (POS, "LimitParam/LSType", 7),
            (POS, "LimitParam/PositiveLSType", 6),
            (POS, "LimitParam/LSDec", 0.0),
            (POS, "LimitParam/LSDirection", 2),
            (POS, "FeedbackParam/PosSetWidth", -1.0),
            (POS, "AlarmParam/FollowingErrorType", 2),
            (POS, "SyncParam/SyncGain", math.nan),
            (N_AXES - 1, "EmergencyStopParam/EStopDec", 0.0),
            (None, "EmergencyStopParam/EStopSignalByteAddress", 4),
            (None, "EmergencyStopParam/EStopSignalSource", 1),
            (None, "EmergencyStopParam/EnableEStopSignal", 2),
        ],
    )
    def test_one_bad_value_and_nothing_is_set(self, fresh: Engine, axis: int | None, key: str, value: Any) -> None:
        before = values(fresh)
        wanted = changed(fresh, axis, key, value)
        for number in range(N_AXES):
            wanted.of_axes[number][AXIS.index("FeedbackParam/InPosWidth")] = 0.125
        assert apply(fresh, wanted) == INVALID
        assert values(fresh) == before

    def test_a_file_of_fewer_axes(self, fresh: Engine) -> None:
        wanted = values(fresh)
        wanted.of_axes[N_AXES - 1] = [0] * len(AXIS)  # as a missing block is read
        assert apply(fresh, wanted) == INVALID
        assert apply(fresh, ParameterValues(wanted.of_engine, wanted.of_axes[:2])) == ErrorCode.AxisCountOutOfRange
        assert apply(fresh, ParameterValues(wanted.of_engine[:3], values(fresh).of_axes)) == INVALID

    def test_changed_gear_ratio_rescales_positions_and_clears_homing(self, fresh: Engine) -> None:
        fresh.set_position(POS, Real.POS_CMD, 8.0)
        fresh.cycle()
        offset = fresh.arrays.reals[Real.HOME_OFFSET, POS]
        fresh.arrays.flags[Flag.HOME_DONE, POS] = 1
        present = values(fresh)
        assert parse(render(present).encode(), N_AXES) == present
        assert apply(fresh, present) == 0
        assert fresh.arrays.flags[Flag.HOME_DONE, POS], "the same gear leaves a homed axis homed"
        wanted = changed(fresh, POS, "AxisParam/AxisGearRatioNumerator", 2 * 131072.0)
        assert apply(fresh, wanted) == 0
        assert fresh.arrays.reals[Real.ACTUAL_POS, POS] == pytest.approx((8.0 + offset) / 2 - offset)
        assert not fresh.arrays.flags[Flag.HOME_DONE, POS]

    def test_an_absolute_axis_takes_its_offset_and_stays_homed(self, fresh: Engine) -> None:
        before = fresh.arrays.reals[Real.ACTUAL_POS, POS_MIRRORED]
        assert fresh.arrays.reals[Real.HOME_OFFSET, POS_MIRRORED] == 0.5
        assert apply(fresh, changed(fresh, POS_MIRRORED, "AxisParam/AbsoluteEncoderHomeOffset", 0.75)) == 0
        assert fresh.arrays.reals[Real.ACTUAL_POS, POS_MIRRORED] == pytest.approx(before - 0.25)
        assert fresh.arrays.flags[Flag.HOME_DONE, POS_MIRRORED]


@pytest.fixture(scope="module")
def arm() -> Engine:
    config = load(EngineConfig, "wmx_engine_manipulator")
    return Engine(config, VirtualDrives(config.n_axes, config.cycle_time_s))


class TestArmsFile:
    """config/wmx/cr3a_wmx_parameters.xml, written by ``robot-stack wmx export --engine-config``."""

    PATH = config_dir() / "wmx" / "cr3a_wmx_parameters.xml"

    def test_shipped_parameter_file_equals_engine_defaults_of_arm(self, arm: Engine) -> None:
        assert self.PATH.read_text(encoding="utf-8") == render(values(arm)), "export it again"

    def test_export_writes_it_without_an_engine(self, tmp_path: Path) -> None:
        engine_config = str(config_dir() / "wmx_engine_manipulator.yaml")
        written = tmp_path / "written.xml"
        result = CliRunner().invoke(app, ["wmx", "export", str(written), "--engine-config", engine_config])
        assert result.exit_code == 0
        assert written.read_bytes() == self.PATH.read_bytes()

    def test_a_folder_that_does_not_exist_is_named(self, tmp_path: Path) -> None:
        result = CliRunner().invoke(app, ["wmx", "export", str(tmp_path / "no" / "folder.xml")])
        assert isinstance(result.exception, CommandError)
        assert "folder.xml cannot be written: No such file" in str(result.exception)

    def test_the_engine_takes_it(self, arm: Engine) -> None:
        read = read_file(str(self.PATH), arm.arrays.n_axes)
        assert apply(arm, read) == 0
        assert values(arm) == read
