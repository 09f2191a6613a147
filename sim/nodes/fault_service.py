"""The service that injects faults into a simulated device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract.model import Service
from robot_stack.middleware.node import StackNode
from sim.plant.fault_table import FaultRefused
from sim.run.requests import NotServed


def serve_faults(node: StackNode, row: Service, inject: Callable[[str, str, float, float], str]) -> None:
    """Offers ``row``, of type InjectFault.

    inject: takes kind, target, value and duration_s (0: until cleared), returns a description; FaultRefused and
    NotServed are returned to the client as refusals.
    """

    def answer(request: Any, response: Any) -> Any:
        try:
            response.message = inject(request.kind, request.target, request.value, request.duration_s)
            response.success = True
            node.get_logger().warning(f"fault: {response.message}")
        except (FaultRefused, NotServed) as error:
            response.message = str(error)
        return response

    node.serve(row, answer)
