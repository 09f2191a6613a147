"""From the contract's words to rclpy's objects: message classes and QoS profiles."""

from __future__ import annotations

import importlib
import math
from functools import cache
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from robot_stack.contract.model import Qos, Topic

# Who is busy for a moment shall lose nothing: a second of every topic is kept, and some messages of the rare ones.
_DEPTH_S = 1.0
_LEAST_DEPTH = 10


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


def listener_profile(row: Topic) -> QoSProfile:
    """The row's QoS for who wants every message, deeper: depth is no matter between publisher and subscriber."""
    profile = qos_profile(row.qos)
    profile.depth = max(row.qos.depth, _LEAST_DEPTH, math.ceil((row.rate_hz or 0.0) * _DEPTH_S))
    return profile
