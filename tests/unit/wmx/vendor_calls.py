"""Every call of the port and what must reach the vendor's module for it: its name there, and its plain arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import (
    AdvMotion_PointTimeSplineCommand,
    AdvMotion_SplinePoint,
    AxisSelection,
    Motion_JogCommand,
    Motion_PosCommand,
    Motion_TimedJogCommand,
    Profile,
    ProfileType,
    Velocity_TimedVelCommand,
    Velocity_VelCommand,
)

Case = tuple[Callable[[MotionEngine], Any], tuple[Any, ...]]
PATH: Final = "/nowhere/parameters.xml"


def profile() -> Profile:
    """A profile no two fields of which are alike."""
    return Profile(ProfileType.Trapezoidal, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5)


def pos(axis: int, target: float) -> Motion_PosCommand:
    return Motion_PosCommand(axis, target, profile())


PROFILE: Final = {
    "type": 0,
    "velocity": 1.5,
    "acc": 2.5,
    "dec": 3.5,
    "jerkAcc": 0.0,
    "jerkDec": 0.0,
    "jerkAccRatio": 0.0,
    "jerkDecRatio": 0.0,
    "accTimeMilliseconds": 4.5,
    "decTimeMilliseconds": 5.5,
    "startingVelocity": 6.5,
    "endVelocity": 7.5,
    "secondVelocity": 0.0,
    "movingAverageTimeMilliseconds": 0.0,
}
SELECTION: Final = {"axisCount": 2, "axis": [4, 2] + [0] * 126}


def _pos(axis: int, target: float) -> dict[str, Any]:
    return {"axis": axis, "target": target, "profile": PROFILE}


def _two() -> AxisSelection:
    return AxisSelection.of(4, 2)


def _spline() -> tuple[AdvMotion_PointTimeSplineCommand, list[AdvMotion_SplinePoint]]:
    rows = [AdvMotion_SplinePoint([1.25, -2.5]), AdvMotion_SplinePoint([3.75, -4.0])]
    return AdvMotion_PointTimeSplineCommand(2, [4, 2]), rows


CALLS: Final[dict[str, Case]] = {
    "WMX3Api.StartEngine": (lambda e: e.api.StartEngine("/nowhere", 7), ("/nowhere", 7)),
    "WMX3Api.StartCommunication": (lambda e: e.api.StartCommunication(15000), (15000,)),
    "WMX3Api.GetEngineStatus": (lambda e: e.api.GetEngineStatus(), ()),
    "WMX3Api.SetDeviceName": (lambda e: e.api.SetDeviceName("other"), ("other",)),
    "WMX3Api.GetDeviceName": (lambda e: e.api.GetDeviceName(), ()),
    "WMX3Api.GetDeviceID": (lambda e: e.api.GetDeviceID(), ()),
    "WMX3Api.GetAllDevices": (lambda e: e.api.GetAllDevices(), ()),
    "WMX3Api.SetWatchdog": (lambda e: e.api.SetWatchdog(0), (0,)),
    "WMX3Api.GetWatchdog": (lambda e: e.api.GetWatchdog(), ()),
    "WMX3Api.ResetWatchdogTimer": (lambda e: e.api.ResetWatchdogTimer(), ()),
    "WMX3Api.AutoQuitWithoutActiveDev": (lambda e: e.api.AutoQuitWithoutActiveDev(1), (True,)),  # type: ignore[arg-type]
    "WMX3Api.IsDeviceValid": (lambda e: e.api.IsDeviceValid(), ()),
    "CoreMotion.GetStatus": (lambda e: e.core_motion.GetStatus(), ()),
    "CoreMotion.ExecEStop": (lambda e: e.core_motion.ExecEStop(1), (1,)),
    "CoreMotion.ReleaseEStop": (lambda e: e.core_motion.ReleaseEStop(), ()),
    "axisControl.SetServoOn": (lambda e: e.core_motion.axisControl.SetServoOn(2, 0), (2, 0)),
    "axisControl.SetServoOn_AxisSel": (
        lambda e: e.core_motion.axisControl.SetServoOn_AxisSel(_two(), 0),
        (SELECTION, 0),
    ),
    "axisControl.ClearAmpAlarm": (lambda e: e.core_motion.axisControl.ClearAmpAlarm(2), (2,)),
    "axisControl.ClearAmpAlarm_AxisSel": (
        lambda e: e.core_motion.axisControl.ClearAmpAlarm_AxisSel(_two()),
        (SELECTION,),
    ),
    "axisControl.ClearAxisAlarm": (lambda e: e.core_motion.axisControl.ClearAxisAlarm(2), (2,)),
    "axisControl.ClearAxisAlarm_AxisSel": (
        lambda e: e.core_motion.axisControl.ClearAxisAlarm_AxisSel(_two()),
        (SELECTION,),
    ),
    "axisControl.SetAxisCommandMode": (lambda e: e.core_motion.axisControl.SetAxisCommandMode(3, 1), (3, 1)),
    "axisControl.GetAxisCommandMode": (lambda e: e.core_motion.axisControl.GetAxisCommandMode(3), (3,)),
    "axisControl.GetPosCommand": (lambda e: e.core_motion.axisControl.GetPosCommand(3), (3,)),
    "axisControl.GetPosFeedback": (lambda e: e.core_motion.axisControl.GetPosFeedback(3), (3,)),
    "axisControl.GetVelCommand": (lambda e: e.core_motion.axisControl.GetVelCommand(3), (3,)),
    "axisControl.GetVelFeedback": (lambda e: e.core_motion.axisControl.GetVelFeedback(3), (3,)),
    "motion.StartPos": (lambda e: e.core_motion.motion.StartPos(pos(2, 8.5)), (_pos(2, 8.5),)),
    "motion.StartPos of two": (
        lambda e: e.core_motion.motion.StartPos(2, [pos(4, 8.5), pos(2, 9.5)]),
        (2, [_pos(4, 8.5), _pos(2, 9.5)]),
    ),
    "motion.StartMov": (lambda e: e.core_motion.motion.StartMov(pos(2, 8.5)), (_pos(2, 8.5),)),
    "motion.StartJog": (
        lambda e: e.core_motion.motion.StartJog(Motion_JogCommand(2, profile())),
        ({"axis": 2, "profile": PROFILE},),
    ),
    "motion.StartJog_TimedJog": (
        lambda e: e.core_motion.motion.StartJog_TimedJog(Motion_TimedJogCommand(2, 11.5, profile())),
        ({"axis": 2, "runTimeMilliseconds": 11.5, "profile": PROFILE},),
    ),
    "motion.Stop": (lambda e: e.core_motion.motion.Stop(2), (2,)),
    "motion.Stop_AxisSel": (lambda e: e.core_motion.motion.Stop_AxisSel(_two()), (SELECTION,)),
    "motion.Stop_Dec": (lambda e: e.core_motion.motion.Stop_Dec(2, 12.5), (2, 12.5)),
    "motion.ExecQuickStop": (lambda e: e.core_motion.motion.ExecQuickStop(2), (2,)),
    "motion.ExecQuickStop_AxisSel": (lambda e: e.core_motion.motion.ExecQuickStop_AxisSel(_two()), (SELECTION,)),
    "motion.ExecTimedStop_TimeMilli": (
        lambda e: e.core_motion.motion.ExecTimedStop_TimeMilli(2, 13.5),
        (2, 13.5),
    ),
    "motion.ExecTimedStop_AxisSel": (
        lambda e: e.core_motion.motion.ExecTimedStop_AxisSel(_two(), 13.5),
        (SELECTION, 13.5),
    ),
    "velocity.StartVel": (
        lambda e: e.core_motion.velocity.StartVel(Velocity_VelCommand(1, profile())),
        ({"axis": 1, "profile": PROFILE},),
    ),
    "velocity.StartVel_TimedVel": (
        lambda e: e.core_motion.velocity.StartVel_TimedVel(Velocity_TimedVelCommand(1, 14.5, profile())),
        ({"axis": 1, "runTimeMilliseconds": 14.5, "profile": PROFILE},),
    ),
    "velocity.Stop": (lambda e: e.core_motion.velocity.Stop(1), (1,)),
    "velocity.Stop_AxisSel": (lambda e: e.core_motion.velocity.Stop_AxisSel(_two()), (SELECTION,)),
    "velocity.ExecQuickStop": (lambda e: e.core_motion.velocity.ExecQuickStop(1), (1,)),
    "velocity.ExecQuickStop_AxisSel": (lambda e: e.core_motion.velocity.ExecQuickStop_AxisSel(_two()), (SELECTION,)),
    "velocity.ExecTimedStop_TimeMilli": (
        lambda e: e.core_motion.velocity.ExecTimedStop_TimeMilli(1, 13.5),
        (1, 13.5),
    ),
    "velocity.ExecTimedStop_AxisSel": (
        lambda e: e.core_motion.velocity.ExecTimedStop_AxisSel(_two(), 13.5),
        (SELECTION, 13.5),
    ),
    "home.StartHome": (lambda e: e.core_motion.home.StartHome(2), (2,)),
    "home.StartHome_AxisSel": (lambda e: e.core_motion.home.StartHome_AxisSel(_two()), (SELECTION,)),
    "home.Cancel": (lambda e: e.core_motion.home.Cancel(2), (2,)),
    "home.SetCommandPos": (lambda e: e.core_motion.home.SetCommandPos(2, 15.5), (2, 15.5)),
    "home.SetFeedbackPos": (lambda e: e.core_motion.home.SetFeedbackPos(2, 15.5), (2, 15.5)),
    "home.SetHomeDone": (lambda e: e.core_motion.home.SetHomeDone(2, 1), (2, 1)),
    "config.SetGearRatio": (lambda e: e.core_motion.config.SetGearRatio(2, 131072.0, 6.5), (2, 131072.0, 6.5)),
    "config.GetGearRatio": (lambda e: e.core_motion.config.GetGearRatio(2), (2,)),
    "config.SetAxisPolarity": (lambda e: e.core_motion.config.SetAxisPolarity(2, -1), (2, -1)),
    "config.GetAxisPolarity": (lambda e: e.core_motion.config.GetAxisPolarity(2), (2,)),
    "config.GetFeedbackParam": (lambda e: e.core_motion.config.GetFeedbackParam(2), (2,)),
    "config.GetHomeParam": (lambda e: e.core_motion.config.GetHomeParam(2), (2,)),
    "config.GetLimitParam": (lambda e: e.core_motion.config.GetLimitParam(2), (2,)),
    "config.GetMotionParam": (lambda e: e.core_motion.config.GetMotionParam(2), (2,)),
    "config.GetAlarmParam": (lambda e: e.core_motion.config.GetAlarmParam(2), (2,)),
    "config.GetEmergencyStopParam": (lambda e: e.core_motion.config.GetEmergencyStopParam(), ()),
    "config.GetParam": (lambda e: e.core_motion.config.GetParam(), ()),
    "config.GetAxisParam": (lambda e: e.core_motion.config.GetAxisParam(), ()),
    "config.ImportAndSetAll": (lambda e: e.core_motion.config.ImportAndSetAll(PATH), (PATH,)),
    "config.GetAndExportAll": (lambda e: e.core_motion.config.GetAndExportAll(PATH), (PATH,)),
    "Io.SetOutBit": (lambda e: e.io.SetOutBit(3, 5, 1), (3, 5, 1)),
    "Io.GetOutBit": (lambda e: e.io.GetOutBit(3, 5), (3, 5)),
    "Io.GetInBit": (lambda e: e.io.GetInBit(3, 5), (3, 5)),
    "Io.SetOutByte": (lambda e: e.io.SetOutByte(3, 129), (3, 129)),
    "Io.GetOutByte": (lambda e: e.io.GetOutByte(3), (3,)),
    "Io.GetInByte": (lambda e: e.io.GetInByte(3), (3,)),
    "Io.SetOutBytes": (lambda e: e.io.SetOutBytes(1, 3, [7, 8, 9]), (1, 3, [7, 8, 9])),
    "Io.GetOutBytes": (lambda e: e.io.GetOutBytes(1, 3), (1, 3)),
    "Io.GetInBytes": (lambda e: e.io.GetInBytes(1, 3), (1, 3)),
    "Ecat.ScanNetwork": (lambda e: e.ecat.ScanNetwork(0), ()),
    "Ecat.GetMasterInfo": (lambda e: e.ecat.GetMasterInfo(), ()),
    "Ecat.RegisterRead": (lambda e: e.ecat.RegisterRead(2, 0x130, 4), (2, 0x130, 4)),
    "Ecat.ResetTransmitStatisticsInfo": (lambda e: e.ecat.ResetTransmitStatisticsInfo(), ()),
    "Ecat.StartHotconnect": (lambda e: e.ecat.StartHotconnect(), ()),
    "advMotion.CreateSplineBuffer": (lambda e: e.advanced_motion.advMotion.CreateSplineBuffer(9, 100), (9, 100)),
    "advMotion.GetSplineBufferPoints": (lambda e: e.advanced_motion.advMotion.GetSplineBufferPoints(9), (9,)),
    "advMotion.StartCSplinePos_PointTime": (
        lambda e: e.advanced_motion.advMotion.StartCSplinePos_PointTime(9, _spline()[0], 2, _spline()[1], [100, 200]),
        (
            9,
            {"dimensionCount": 2, "axis": [4, 2, 0, 0, 0, 0]},
            2,
            [{"pos": [1.25, -2.5, 0, 0, 0, 0]}, {"pos": [3.75, -4.0, 0, 0, 0, 0]}],
            [100, 200],
        ),
    ),
    "advMotion.FreeSplineBuffer": (lambda e: e.advanced_motion.advMotion.FreeSplineBuffer(9), (9,)),
    "WMX3Api.StopCommunication": (lambda e: e.api.StopCommunication(16000), (16000,)),
    "WMX3Api.RestartEngine": (lambda e: e.api.RestartEngine("/nowhere", 17000), ("/nowhere", 17000)),
    "WMX3Api.StopEngine": (lambda e: e.api.StopEngine(18000), (18000,)),
    "WMX3Api.CloseDevice": (lambda e: e.api.CloseDevice(), ()),
}
ELSEWHERE: Final = frozenset(
    {"CreateDevice", "ErrorToString"} | {f"Set{kind}Param" for kind in ("Feedback", "Home", "Limit", "Motion", "Alarm")}
) | {"SetEmergencyStopParam", "Wait", "Wait_AxisSel", "Wait_TimeMilli", "Wait_AxisSel_TimeMilli"}
"""Calls of the port that have tests of their own: they are more than one call of the vendor's, or none."""


def check(engine: MotionEngine, module: Any, name: str) -> None:
    """Makes one call. Asserts that it reached the vendor's module as listed, and that nothing was wrong with it."""
    control = module.CONTROL
    call, expected = CALLS[name]
    if name.startswith("Ecat.") and module.VARIANT.ecat_takes_master:
        expected = (0, *expected)
    called = name.split(" ")[0]
    before = len(control.named(called))
    call(engine)
    found = control.named(called)[before:]
    assert found, f"{called} never reached the vendor's module"
    assert found[-1] == expected
    assert control.faults == []
