"""Axes that a session starts together: their faults, and the requests to clear these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robot_stack.wmx.api import AxisSelection
from robot_stack.wmx.axes import BoolRow, StatusSnapshot
from robot_stack.wmx.session import EngineSession

SERVO_ON, CLEARING = "servo on", "clearing alarms"
"""Requests, as named in refusals."""


class AxisGroup:
    """Repeats an unfulfilled request at most once per ``request_pause_s``."""

    def __init__(self, session: EngineSession, names: Mapping[int, str], request_pause_s: float) -> None:
        """names: names of the axes by their numbers, used in faults."""
        self._session, self._names, self._pause_s = session, names, request_pause_s

    def where(self, wrong: BoolRow) -> list[int]:
        return [axis for axis in self._names if wrong[axis]]

    def faults(self, snapshot: StatusSnapshot) -> str:
        """The alarms of drives and engine as text, empty if there are none."""
        texts = [
            f"{self._names[axis]} alarm {int(snapshot.amp_alarm_code[axis])}" for axis in self.where(snapshot.amp_alarm)
        ]
        following = self.where(snapshot.following_error_alarm)
        return ", ".join([*texts, *(f"{self._names[axis]} following error" for axis in following)])

    def clear_alarms(self, snapshot: StatusSnapshot, now_s: float) -> None:
        """Clears the drives' alarms. Only for standing axes; it moves nothing: the servos are off."""
        amplifier, following = self.where(snapshot.amp_alarm), self.where(snapshot.following_error_alarm)
        if not (amplifier or following) or not self._session.due(CLEARING, now_s, self._pause_s):
            return
        of_drives, of_engine = AxisSelection.of(*amplifier), AxisSelection.of(*following)
        ask = self._session.ask
        if amplifier:
            ask(CLEARING, lambda engine: engine.core_motion.axisControl.ClearAmpAlarm_AxisSel(of_drives))
        if following:
            ask(CLEARING, lambda engine: engine.core_motion.axisControl.ClearAxisAlarm_AxisSel(of_engine))

    def switch_on(self, axes: Sequence[int]) -> None:
        selection = AxisSelection.of(*axes)
        self._session.ask(SERVO_ON, lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(selection, 1))

    def switch_off(self) -> None:
        """Switches all servos off; holding brakes close. Only for axes at rest."""
        selection = AxisSelection.of(*self._names)
        self._session.ask("servo off", lambda engine: engine.core_motion.axisControl.SetServoOn_AxisSel(selection, 0))
