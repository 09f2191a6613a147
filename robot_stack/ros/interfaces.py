"""From the contract's words to rclpy's objects: message classes and QoS profiles."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from robot_stack.contract.model import Qos


@cache
def interface_class(type_name: str) -> Any:
    """The class of ``package/msg/Name``, ``package/srv/Name`` or ``package/action/Name``. Raises ImportError."""
    package, kind, name = type_name.split("/")
    module = importlib.import_module(f"{package}.{kind}")
    try:
        return getattr(module, name)
    except AttributeError as error:
        raise ImportError(f"{package} has no {kind} named {name}") from error


def qos_profile(qos: Qos) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.name],
        durability=DurabilityPolicy[qos.durability.name],
    )
