"""Tools outside the process table on the scheduler: the operator, and observers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract.model import ContractViolation, Topic
from robot_stack.middleware.port import Port, Publisher, open_port


class ToolNode:
    """A node of a tool. It has no heartbeat and no parameters."""

    def __init__(self, name: str) -> None:
        self.port: Port = open_port(name)

    def advertise(self, row: Topic) -> Publisher:
        """Raises ContractViolation if the row does not name this tool."""
        if self.port.name not in row.publishers:
            raise ContractViolation(f"{self.port.name} may not publish {row.name}")
        return self.port.advertise(row, row.name)

    def subscribe(self, row: Topic, callback: Callable[[Any], None]) -> None:
        """Tools may subscribe to any row. Every message is taken."""
        self.port.listen(row, lambda message, *_: callback(message), raw=False, wakes=True)

    def safe_output(self) -> None:
        """Does nothing: a tool moves nothing by itself."""

    def destroy_node(self) -> None:
        self.port.close()
