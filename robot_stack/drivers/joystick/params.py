"""Parameters of the node joystick_driver: ``config/joystick_driver.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

Number = Annotated[int, Field(ge=0, le=31)]


class JoystickAxis(Config):
    """number: of the joystick's axis. full: at its positive end, m/s or rad/s; negative to invert it."""

    number: Number
    full: Annotated[float, Field(ge=-1.5, le=1.5)]


class JoystickDriverParams(Config):
    """device: of the kernel's joystick interface; a relative name lies in the runtime folder.

    dead_man_button: held while the robot may move. dead_zone: share of an axis' range. quiet_s: timeout without events,
    after which the joystick counts as released: a radio out of reach sends nothing. zero_s: duration of zero
    commands after a release, before the drive is left to others. reopen_s: pause after a failed open.
    """

    device: Annotated[str, Field(min_length=1)]
    dead_man_button: Number
    forward_mps: JoystickAxis
    left_mps: JoystickAxis
    turn_radps: JoystickAxis
    dead_zone: Annotated[float, Field(gt=0.0, le=0.5)]
    quiet_s: Annotated[float, Field(gt=0.0, le=10.0)]
    zero_s: Annotated[float, Field(gt=0.0, le=1.0)]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]

    @model_validator(mode="after")
    def _an_axis_commands_one_thing(self) -> JoystickDriverParams:
        axes = {self.forward_mps.number, self.left_mps.number, self.turn_radps.number}
        if len(axes) < 3:
            raise ValueError("forward_mps, left_mps and turn_radps must be three axes")
        return self
