"""A list of start-up steps on a session with the engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.session import EngineSession

StageT = TypeVar("StageT")
Step = Callable[[StatusSnapshot, float], "tuple[StageT, str] | None"]
"""(status, now) -> (stage, reason), after requesting the missing step; None if nothing is missing."""


@dataclass(frozen=True, slots=True)
class SessionState(Generic[StageT]):
    """snapshot: the engine's present status, None without a valid one."""

    stage: StageT
    text: str
    snapshot: StatusSnapshot | None = None


class StartUp(Generic[StageT]):
    """A list of start-up steps, checked at every poll: the first unfulfilled one gives the stage.

    A step that is lost again is requested again. connected: called for every new device.
    """

    def __init__(
        self,
        session: EngineSession,
        axes: Sequence[int],
        steps: Sequence[Step[StageT]],
        connecting: StageT,
        ready: StageT,
        connected: Callable[[], None],
    ) -> None:
        self._session, self._axes, self._steps = session, tuple(axes), tuple(steps)
        self._connecting, self._ready, self._connected = connecting, ready, connected
        self._connection = 0

    def poll(self, now_s: float) -> SessionState[StageT]:
        """Reads the status and requests the next missing step."""
        session = self._session
        session.poll(now_s)
        if session.connections != self._connection:
            self._connection = session.connections
            self._connected()
        snapshot = session.read()
        if snapshot is None:
            return SessionState(self._connecting, session.problem)
        if snapshot.n_axes <= max(self._axes):
            return SessionState(self._connecting, f"axes {self._axes} of an engine with {snapshot.n_axes}")
        stage, text = self._standing(snapshot, now_s)
        if session.engine is None:  # lost during a step
            return SessionState(self._connecting, session.problem)
        return SessionState(stage, text, snapshot if snapshot.communicating else None)

    def _standing(self, snapshot: StatusSnapshot, now_s: float) -> tuple[StageT, str]:
        for step in self._steps:
            missing = step(snapshot, now_s)
            if missing is not None:
                return missing
        return self._ready, "ready"
