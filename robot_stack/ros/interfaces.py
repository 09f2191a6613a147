"""Conversion of the contract's QoS to rclpy profiles."""

from __future__ import annotations

import math

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from robot_stack.contract.model import Qos, Topic
from robot_stack.middleware.interfaces import interface_class

# A listener that is busy for a moment loses nothing: one second of every topic is kept, at least some messages.
_DEPTH_S = 1.0
_LEAST_DEPTH = 10


def qos_profile(qos: Qos) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.name],
        durability=DurabilityPolicy[qos.durability.name],
    )


def listener_profile(row: Topic) -> QoSProfile:
    """The row's QoS with a deeper history, for receiving every message; depth is not matched between endpoints."""
    profile = qos_profile(row.qos)
    profile.depth = max(row.qos.depth, _LEAST_DEPTH, math.ceil((row.rate_hz or 0.0) * _DEPTH_S))
    return profile


__all__ = ["interface_class", "listener_profile", "qos_profile"]
