"""Parameters of the simulated engine, as its clients read and set them."""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any, TypeVar, cast

from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.parameters import (
    Config_AlarmParam,
    Config_AxisParam,
    Config_EmergencyStopParam,
    Config_FeedbackParam,
    Config_HomeParam,
    Config_LimitParam,
    Config_MotionParam,
    Config_SystemParam,
)
from robot_stack.wmx.simulated.parameter_blocks import BLOCKS, from_wire, to_wire
from robot_stack.wmx.simulated.parameter_file import ParameterFileError, ParameterValues, read_file, write_file

if TYPE_CHECKING:
    from robot_stack.wmx.simulated.client import WMX3Api

BlockT = TypeVar("BlockT")


class Config:
    """Blocks are copies: change one and set it."""

    def __init__(self, api: WMX3Api) -> None:
        self._api = api

    def SetGearRatio(self, axis: int, numerator: float, denominator: float) -> int:
        return self._api.command("SetGearRatio", operator.index(axis), float(numerator), float(denominator))

    def GetGearRatio(self, axis: int) -> tuple[int, float, float]:
        code, values = self._api.call("GetGearRatio", operator.index(axis))
        return (code, 0.0, 0.0) if code else (code, values[0], values[1])

    def SetAxisPolarity(self, axis: int, polarity: int) -> int:
        return self._api.command("SetAxisPolarity", operator.index(axis), operator.index(polarity))

    def GetAxisPolarity(self, axis: int) -> tuple[int, int]:
        code, values = self._api.call("GetAxisPolarity", operator.index(axis))
        return (code, 0) if code else (code, values[0])

    def GetFeedbackParam(self, axis: int) -> tuple[int, Config_FeedbackParam]:
        return self._get("feedback", axis, Config_FeedbackParam)

    def SetFeedbackParam(self, axis: int, param: Config_FeedbackParam) -> tuple[int, Config_FeedbackParam]:
        return self._set("feedback", axis, param)

    def GetHomeParam(self, axis: int) -> tuple[int, Config_HomeParam]:
        return self._get("home", axis, Config_HomeParam)

    def SetHomeParam(self, axis: int, param: Config_HomeParam) -> tuple[int, Config_HomeParam]:
        return self._set("home", axis, param)

    def GetLimitParam(self, axis: int) -> tuple[int, Config_LimitParam]:
        return self._get("limit", axis, Config_LimitParam)

    def SetLimitParam(self, axis: int, param: Config_LimitParam) -> tuple[int, Config_LimitParam]:
        return self._set("limit", axis, param)

    def GetMotionParam(self, axis: int) -> tuple[int, Config_MotionParam]:
        return self._get("motion", axis, Config_MotionParam)

    def SetMotionParam(self, axis: int, param: Config_MotionParam) -> tuple[int, Config_MotionParam]:
        return self._set("motion", axis, param)

    def GetAlarmParam(self, axis: int) -> tuple[int, Config_AlarmParam]:
        return self._get("alarm", axis, Config_AlarmParam)

    def SetAlarmParam(self, axis: int, param: Config_AlarmParam) -> tuple[int, Config_AlarmParam]:
        return self._set("alarm", axis, param)

    def GetEmergencyStopParam(self) -> tuple[int, Config_EmergencyStopParam]:
        code, values = self._api.call("GetEmergencyStopParam")
        return code, Config_EmergencyStopParam() if code else _block(Config_EmergencyStopParam, values[0])

    def SetEmergencyStopParam(self, param: Config_EmergencyStopParam) -> tuple[int, Config_EmergencyStopParam]:
        return self._api.command("SetEmergencyStopParam", to_wire(param)), param

    def GetParam(self) -> tuple[int, Config_SystemParam]:
        code, values = self._api.call("GetParam")
        if code:
            return code, Config_SystemParam()
        axes, stop = values
        blocks = {name: [_block(kind, item) for item in axes[name]] for name, kind in BLOCKS.items()}
        return code, Config_SystemParam(
            feedbackParam=cast(list[Config_FeedbackParam], blocks["feedback"]),
            homeParam=cast(list[Config_HomeParam], blocks["home"]),
            limitParam=cast(list[Config_LimitParam], blocks["limit"]),
            motionParam=cast(list[Config_MotionParam], blocks["motion"]),
            alarmParam=cast(list[Config_AlarmParam], blocks["alarm"]),
            emergencyStopParam=_block(Config_EmergencyStopParam, stop),
        )

    def GetAxisParam(self) -> tuple[int, Config_AxisParam]:
        code, values = self._api.call("GetAxisParam")
        return code, Config_AxisParam() if code else Config_AxisParam(*values)

    def ImportAndSetAll(self, filePath: str) -> int:
        code, snapshot = self._api.snapshot()
        if code:
            return code
        try:
            values = read_file(filePath, snapshot.n_axes)
        except ParameterFileError:
            return CoreMotionErrorCode.ParameterFileParseError
        except (OSError, ValueError):
            return ErrorCode.FileOperationFailed
        return self._api.command("SetAllParameters", values.of_engine, values.of_axes)

    def GetAndExportAll(self, filePath: str) -> int:
        code, values = self._api.call("GetAllParameters")
        if code:
            return code
        try:
            write_file(filePath, ParameterValues(*values))
        except (OSError, ValueError):
            return ErrorCode.FileOperationFailed
        return ErrorCode.PyNone

    def _get(self, name: str, axis: int, kind: type[BlockT]) -> tuple[int, BlockT]:
        code, values = self._api.call("GetBlock", name, operator.index(axis))
        return code, kind() if code else _block(kind, values[0])

    def _set(self, name: str, axis: int, param: BlockT) -> tuple[int, BlockT]:
        return self._api.command("SetBlock", name, operator.index(axis), to_wire(param)), param


def _block(kind: type[BlockT], data: Any) -> BlockT:
    block = from_wire(kind, data)
    assert block is not None, f"the engine sent no {kind.__name__}: {data!r} ({ErrorCode.APIChannelError.name})"
    return block
