"""Waking a thread from the middleware's own threads, without a wait set and without Python.

rmw attaches every entity again at each wait of a wait set: 0.3 to 0.7 ms of processor time for 10 to 30 entities, each
time. Here rcl calls ``eventfd_write`` of the C library for each new message: its signature (descriptor, count) is that
of rcl's event callback (user data, number of events). The thread then waits in one ``epoll`` for all descriptors.

Source: rcl/event_callback.h (Jazzy), eventfd(2).
"""

from __future__ import annotations

import ctypes
import os
import select
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.action import ActionClient, ActionServer
from rclpy.client import Client
from rclpy.service import Service
from rclpy.subscription import Subscription

_WRITE = ctypes.cast(ctypes.CDLL(None).eventfd_write, ctypes.c_void_p)
_ACTION_SERVER = (
    "rcl_action_server_set_goal_service_callback",
    "rcl_action_server_set_cancel_service_callback",
    "rcl_action_server_set_result_service_callback",
)
_ACTION_CLIENT = (
    "rcl_action_client_set_goal_client_callback",
    "rcl_action_client_set_cancel_client_callback",
    "rcl_action_client_set_result_client_callback",
    "rcl_action_client_set_feedback_subscription_callback",
    "rcl_action_client_set_status_subscription_callback",
)


class WakeupError(RuntimeError):
    """rcl refused an event callback."""


class Wakeups:
    """Event descriptors of entities, and of ``wake``; ``wait`` returns those that have been written to.

    One thread waits; ``wake`` may be called from any, and from a signal handler.
    """

    def __init__(self) -> None:
        self._epoll = select.epoll()
        self._own = self._descriptor()
        self._entities: dict[int, Any] = {}
        self._undo: dict[int, Callable[[], None]] = {}

    def wake(self) -> None:
        os.eventfd_write(self._own, 1)

    def wait(self, timeout_s: float) -> tuple[bool, list[tuple[Any, int]]]:
        """Waits at most ``timeout_s``. Returns whether ``wake`` was called, and the entities with new events, each with
        their number since it was last returned.
        """
        woken, ready = False, []
        for descriptor, _ in self._epoll.poll(timeout_s):
            count = os.eventfd_read(descriptor)
            if descriptor == self._own:
                woken = True
            else:
                ready.append((self._entities[descriptor], count))
        return woken, ready

    def pending(self) -> bool:
        """True if ``wait`` would return at once. For any thread."""
        return bool(self._epoll.poll(0.0))

    def follow(self, entity: Any) -> None:
        """From now on ``wait`` returns the entity when it has new events, including those already there.

        The caller keeps the entity's handle alive until ``forget``. Raises WakeupError.
        """
        descriptor = self._descriptor()
        library, handle, setters = _setters(entity)
        self._undo[descriptor] = lambda: _set(library, handle, setters, None, 0)
        self._entities[descriptor] = entity
        _set(library, handle, setters, _WRITE, descriptor)

    def forget(self, entities: Iterable[Any]) -> None:
        """Ends ``follow``. A callback of the middleware must never use a descriptor that is closed or reused."""
        gone = {id(entity) for entity in entities}
        for descriptor in [number for number, entity in self._entities.items() if id(entity) in gone]:
            self._undo.pop(descriptor)()
            del self._entities[descriptor]
            self._epoll.unregister(descriptor)
            os.close(descriptor)

    def close(self) -> None:
        self.forget(list(self._entities.values()))
        self._epoll.close()
        os.close(self._own)

    def _descriptor(self) -> int:
        descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll.register(descriptor, select.EPOLLIN)
        return descriptor


def can_follow(entity: Any) -> bool:
    """False for entities without an rcl callback: guard conditions, and waitables other than actions."""
    return isinstance(entity, Subscription | Service | Client | ActionServer | ActionClient)


def _setters(entity: Any) -> tuple[ctypes.CDLL, Any, tuple[str, ...]]:
    """(library, handle, functions that set its callbacks)."""
    match entity:
        case Subscription():
            return _rcl("librcl.so"), entity.handle, ("rcl_subscription_set_on_new_message_callback",)
        case Service():
            return _rcl("librcl.so"), entity.handle, ("rcl_service_set_on_new_request_callback",)
        case Client():
            return _rcl("librcl.so"), entity.handle, ("rcl_client_set_on_new_response_callback",)
        case ActionServer():
            return _rcl("librcl_action.so"), entity._handle, _ACTION_SERVER
        case ActionClient():
            return _rcl("librcl_action.so"), entity._client_handle, _ACTION_CLIENT
    raise TypeError(f"nothing wakes for a {type(entity).__name__}")


def _rcl(name: str) -> ctypes.CDLL:
    return ctypes.CDLL(name)  # loaded already, by rclpy


def _set(library: ctypes.CDLL, handle: Any, setters: tuple[str, ...], callback: Any, descriptor: int) -> None:
    for name in setters:
        function = getattr(library, name)
        code = function(ctypes.c_void_p(handle.pointer), callback, ctypes.c_void_p(descriptor))
        if code:
            raise WakeupError(f"{name}: error {code}")
