"""The subscription to another vendor's driver, shared by the adapters: stamps, refusals, silence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from robot_stack.contract.model import Topic
from robot_stack.drivers.vendor.topic import MessageRefused, VendorTopic, VendorTopicParams
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.node import StackNode


class VendorInput:
    """row: of the subscription, under the name and with the reliability of the parameters.

    rate_hz: of the contract's topic. use: publishes a message by its stamp in s, or raises MessageRefused.
    """

    def __init__(
        self,
        node: StackNode,
        row: Topic,
        params: VendorTopicParams,
        rate_hz: float,
        use: Callable[[Any, float], None],
    ) -> None:
        self._node, self._use = node, use
        self._topic = VendorTopic(params, rate_hz)
        asked = replace(row, qos=replace(row.qos, reliability=params.reliability))
        node.subscribe(asked, self._on_message, params.topic)

    def problem(self) -> str:
        """Why nothing is published; empty while messages arrive."""
        return self._topic.problem(self._node.steady_s(), self._node.count_publishers(self._topic.params.topic))

    def values(self) -> dict[str, str]:
        """For /diagnostics."""
        return {"device": f"{self._topic.params.topic} of another driver", **self._topic.counters.values()}

    def _on_message(self, message: Any) -> None:
        try:
            stamp_s = self._topic.stamp(time_to_s(message.header.stamp), self._node.now_s())
            if stamp_s is None:
                return
            self._use(message, stamp_s)
        except MessageRefused as refusal:
            self._topic.refused(str(refusal))
            return
        self._topic.used(self._node.steady_s())
