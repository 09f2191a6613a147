"""Parameters of manipulator_state, ``config/manipulator_state.yaml``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config, Positive
from robot_stack.wmx.api.values import MAX_AXES, MAX_IO_BYTES
from robot_stack.wmx.config import Bit
from robot_stack.wmx.session_params import SessionParams

N_FINGERS = 2
_UNSET = "no_param"


class ManipulatorSessionParams(SessionParams):
    """poll_s: period of polls while there is nothing to publish."""

    poll_s: Positive


class ManipulatorStateParams(Config):
    """``config/manipulator_state.yaml``. A topic or path that is empty or ``no_param`` is not set.

    isaacsim_stamp: the Isaac Sim topic carries the stamp too. auto_servo_on: alarms are cleared and servos switched on
    at the start. status_stale_s: timeout of the engine's cycle counter, after which its status is invalid.
    stop_communication: at the end, if this node started it and no other device is open. end_timeout_s: longest
    wait at the end for joints to stop and servos to go off.
    """

    joint_number: Annotated[int, Field(ge=1, le=MAX_AXES)]
    joint_feedback_rate: Annotated[float, Field(gt=0.0, le=4000.0)]
    gripper_open_value: float
    gripper_close_value: float
    joint_name: tuple[Annotated[str, Field(min_length=1)], ...]
    encoder_joint_topic: str
    isaacsim_joint_topic: str
    gazebo_joint_topic: str
    wmx_param_file_path: str
    gripper_byte: Annotated[int, Field(ge=0, lt=MAX_IO_BYTES)]
    gripper_bit: Bit
    isaacsim_stamp: bool
    auto_servo_on: bool
    stop_communication: bool
    status_stale_s: Positive
    end_timeout_s: Positive
    session: ManipulatorSessionParams

    @model_validator(mode="after")
    def _consistent(self) -> ManipulatorStateParams:
        needed = self.joint_number + N_FINGERS
        if len(self.joint_name) != needed:
            raise ValueError(
                f"joint_name must have joint_number + {N_FINGERS} = {needed} names, has {len(self.joint_name)}"
            )
        twice = sorted({name for name in self.joint_name if self.joint_name.count(name) > 1})
        if twice:
            raise ValueError(f"joint_name: {', '.join(twice)} appears more than once")
        topics = [name for name in self.topics if name]
        if len(set(topics)) != len(topics):
            raise ValueError("encoder_joint_topic, isaacsim_joint_topic and gazebo_joint_topic must differ")
        return self

    @property
    def topics(self) -> tuple[str, str, str]:
        """Names of the encoder, Isaac Sim and Gazebo topics; empty for one that is not set."""
        encoder, isaac, gazebo = self.encoder_joint_topic, self.isaacsim_joint_topic, self.gazebo_joint_topic
        return set_or_empty(encoder), set_or_empty(isaac), set_or_empty(gazebo)

    def parameter_file(self, folder: Path) -> str:
        """The engine's parameter file, a relative path counted from ``folder``; empty if there is none."""
        path = set_or_empty(self.wmx_param_file_path)
        return str(folder / path) if path else ""


def set_or_empty(name: str) -> str:
    """``name``, or "" for the documented forms of an unset name: empty, ``no_param``, ``/<parameter>/no_param``."""
    return "" if name.rpartition("/")[2] in ("", _UNSET) else name
