"""The recorder's subscriptions to camera images, which are created and destroyed as needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import Subscription
from robot_stack.recording.images import DockingWatch, Thinning
from robot_stack.recording.params import SelectionParams

Write = Callable[[str, bytes, int, int], None]


class ImageRecording:
    """Subscribes to images only while they are recorded: receiving them costs as much as writing.

    write: called with topic, bytes and the times in ns at which a message was received and sent.
    """

    def __init__(self, node: StackNode, rows: list[Topic], params: SelectionParams, write: Write) -> None:
        self._node = node
        self._write = write
        self._rows = rows
        self._params = params
        self._thinning = Thinning(params.image_rate_hz)
        self._docking = DockingWatch(params.image_tail_s)
        self._subscriptions: list[Subscription] = []
        self._closed = False
        if params.images == "docking":
            node.listen(topics.DOCKING_STATUS, self._on_status, raw=False, wakes=True)
            node.every(2.0, self._update)  # detects a silent controller
        self._update()

    def _on_status(self, message: Any, *_: int) -> None:
        self._docking.on_status(message.state, self._node.steady_s())
        self._update()

    def _update(self) -> None:
        docking = self._params.images == "docking" and self._docking.active(self._node.steady_s())
        wanted = (docking or self._params.images == "always") and not self._closed
        if wanted and not self._subscriptions:
            self._subscriptions = [self._node.listen(row, partial(self._on_image, row.name)) for row in self._rows]
        elif not wanted and self._subscriptions:
            for subscription in self._subscriptions:
                subscription.end()
            self._subscriptions = []

    def _on_image(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        if self._thinning.keeps(topic, self._node.now_s()):
            self._write(topic, data, received_ns, sent_ns)

    def close(self) -> None:
        self._closed = True
        self._update()
