"""Input of the nodes that need to know whether a wheelchair is attached."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode


class WheelchairInput:
    """``/passenger_attached`` together with ``/docking/latch``.

    Any node may publish ``/passenger_attached``: a false detaches nothing that the docking controller reports attached.
    """

    def __init__(
        self, node: StackNode, changed: Callable[[bool], None] | None = None, *, assumed: bool = False
    ) -> None:
        """changed: called with each new value of ``attached``. assumed: that value until the first message."""
        self.attached = assumed
        self._changed, self._assumed = changed, assumed
        self._passenger = node.subscribe(topics.PASSENGER_ATTACHED, self._update)
        self._latch = node.subscribe(topics.LATCH_STATUS, self._update)

    def _update(self, _: object) -> None:
        passenger, latch = self._passenger.latest, self._latch.latest
        reported = self._assumed if passenger is None else passenger.data
        attached = bool(reported or (latch is not None and latch.attached))
        if attached != self.attached:
            self.attached = attached
            if self._changed is not None:
                self._changed(attached)
