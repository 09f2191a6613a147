"""Subscriptions of the recorder and the black box to every selected row."""

from __future__ import annotations

from functools import partial

from robot_stack.contract.model import Topic
from robot_stack.middleware.node import StackNode
from robot_stack.recording.images import IMAGE_TYPE
from robot_stack.recording.nodes.image_recording import ImageRecording, Write
from robot_stack.recording.params import SelectionParams
from robot_stack.recording.sweeps import SweepChoice

_TAKE_HZ = 10.0


class RowRecording:
    """Passes the messages of ``rows`` to ``write``, images and sweeps as the parameters select them.

    write_image: for images; see ``ImageRecording`` for both.
    """

    def __init__(
        self, node: StackNode, rows: list[Topic], params: SelectionParams, write: Write, write_image: Write
    ) -> None:
        self._node, self._write = node, write
        images = [row for row in rows if row.type == IMAGE_TYPE]
        self._images = ImageRecording(node, images, params, write_image) if images else None
        self._sweeps = SweepChoice(params.sweeps, params.sweep_rate_hz)
        rows = [row for row in rows if row not in images and self._sweeps.subscribes(row)]
        self._subscriptions = [
            node.listen(row, partial(self._on_sweep if self._sweeps.thins(row) else write, row.name)) for row in rows
        ]
        node.every(_TAKE_HZ, self._take)

    def _take(self) -> None:
        """The tick reads the queued messages."""

    def _on_sweep(self, topic: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        if self._sweeps.keeps(topic, self._node.now_s()):
            self._write(topic, data, received_ns, sent_ns)

    def close(self) -> None:
        """Ends the subscriptions."""
        for subscription in self._subscriptions:
            subscription.end()
        self._subscriptions = []
        if self._images is not None:
            self._images.close()
