"""A single-threaded executor that does little per message.

rclpy's own executor builds a wait set, a task and several guard-condition triggers for every callback: 0.3-0.6 ms of
CPU per message on a small machine. This one keeps its wait set until an entity is added or removed and calls
subscriptions, timers and services directly. Waitables (actions, event handlers) and futures still run as rclpy tasks.
"""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.waitable import Waitable

# A wait is cut into pieces of this length: a blocked wait holds Python's signal handlers back, and a piece that takes
# much longer tells that the process itself was held up (a busy or paused machine) and could not have heard anything.
_LONGEST_WAIT_NS = 20_000_000
_PAUSE_S = 0.03
# While a coroutine waits for something, it is asked again this often: rclpy's futures wake no one.
_TASK_POLL_NS = 5_000_000


class LeanExecutor(Executor):
    """Runs the callbacks of its nodes in the thread that spins."""

    def __init__(self, *, context: Any = None) -> None:
        super().__init__(context=context)
        self._tasks: list[Any] = self._tasks  # rclpy's list; declared here for the type checker
        self._wait_set: Any = None
        self._entities = _Entities([])
        # Handles in the wait set stay alive until it is rebuilt, even if another thread destroys their entity.
        self._held = ExitStack()
        self._stop = False

    def spin(self, should_stop: Callable[[], bool] = lambda: False) -> None:
        """Runs callbacks until ``should_stop`` says so or ``stop`` is called. Raises ExternalShutdownException."""
        self._stop = False
        while not self._stop and not should_stop():
            self.spin_once(None)

    def stop(self) -> None:
        """Ends ``spin`` soon; may be called from any thread."""
        self._stop = True
        self.wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self._run_tasks()
        timeout_ns = _LONGEST_WAIT_NS if timeout_sec is None else min(_LONGEST_WAIT_NS, int(timeout_sec * 1e9))
        if not self._context.ok():
            raise ExternalShutdownException()
        if self._wait_set is None:
            self._rebuild()
        start_s = time.monotonic()
        try:
            self._wait(timeout_ns)
        except InvalidHandle:  # an entity was destroyed since the wait set was built
            self._wait_set = None
            return
        late_s = time.monotonic() - start_s - 1e-9 * timeout_ns
        if late_s > _PAUSE_S:
            self._tell_pause(late_s)
        if self._woken() and self._entities.changed(self.get_nodes()):
            self._wait_set = None  # what is ready now is ready still when the new set is waited for
        else:
            self._dispatch()

    def _tell_pause(self, late_s: float) -> None:
        for node in self.get_nodes():
            on_pause = getattr(node, "on_pause", None)
            if on_pause is not None:
                on_pause(late_s)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._wait_set = None
        self._held.close()
        return bool(super().shutdown(timeout_sec))

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        future.add_done_callback(lambda _: self.wake())
        seconds = getattr(timeout_sec, "timeout", timeout_sec)
        if not future.done():
            self.spin_once(seconds)

    def _rebuild(self) -> None:
        self._held.close()
        self._entities = _Entities(self.get_nodes())
        for entity in self._entities.all():
            try:
                self._held.enter_context(entity if isinstance(entity, Waitable) else entity.handle)
            except InvalidHandle:  # being destroyed by another thread: its wake-up is on the way
                self._entities.remove(entity)
        self._wait_set = _rclpy.WaitSet(*self._entities.counts(extra_guards=1), self._context.handle)

    def _woken(self) -> bool:
        return self._guard.handle.pointer in self._wait_set.get_ready_entities("guard_condition")

    def _wait(self, timeout_ns: int) -> None:
        wait_set, entities = self._wait_set, self._entities
        wait_set.clear_entities()
        for subscription in entities.subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in entities.timers:
            wait_set.add_timer(timer.handle)
        for service in entities.services:
            wait_set.add_service(service.handle)
        for client in entities.clients:
            wait_set.add_client(client.handle)
        for guard in entities.guards:
            wait_set.add_guard_condition(guard.handle)
        wait_set.add_guard_condition(self._guard.handle)
        for waitable in entities.waitables:
            waitable.add_to_wait_set(wait_set)
        with self._context.handle:
            wait_set.wait(min(timeout_ns, _TASK_POLL_NS) if self._tasks else timeout_ns)

    def _dispatch(self) -> None:
        wait_set, entities = self._wait_set, self._entities
        for guard in _ready(entities.guards, wait_set.get_ready_entities("guard_condition")):
            if guard.callback is not None:
                self._call(guard.callback)
        for waitable in entities.waitables:
            if waitable.is_ready(wait_set):
                self._start(waitable)
        # Messages before timers: a tick shall see what has already arrived.
        for subscription in _ready(entities.subscriptions, wait_set.get_ready_entities("subscription")):
            self._take_message(subscription)
        for service in _ready(entities.services, wait_set.get_ready_entities("service")):
            self._run(self._take_service(service))
        for client in _ready(entities.clients, wait_set.get_ready_entities("client")):
            self._run(self._take_client(client))
        for timer in _ready(entities.timers, wait_set.get_ready_entities("timer")):
            self._fire(timer)

    def _start(self, waitable: Waitable) -> None:
        data = waitable.take_data()
        for future in waitable._futures:
            future._set_executor(self)
        self.create_task(waitable.execute, data)

    def _fire(self, timer: Any) -> None:
        try:
            if not timer.handle.is_timer_ready():  # cancelled by an earlier callback
                return
            timer.handle.call_timer()
        except InvalidHandle:  # destroyed by an earlier callback
            return
        self._call(timer.callback)

    def _take_message(self, subscription: Any) -> None:
        try:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        except InvalidHandle:  # destroyed by an earlier callback
            return
        if taken is None:
            return
        if subscription._callback_type is Subscription.CallbackType.MessageOnly:
            self._call(subscription.callback, taken[0])
        else:
            self._call(subscription.callback, *taken)

    def _run(self, coroutine_function: Callable[[], Any] | None) -> None:
        if coroutine_function is not None:
            self._finish(coroutine_function())

    def _call(self, callback: Callable[..., Any], *args: Any) -> None:
        result = callback(*args)
        if inspect.iscoroutine(result):
            self._finish(result)

    def _finish(self, coroutine: Any) -> None:
        """Runs a coroutine; one that really waits for something goes on as a task."""
        task = self.create_task(coroutine)
        task()
        if task.done() and task.exception() is not None:
            raise task.exception()

    def _run_tasks(self) -> None:
        if not self._tasks:
            return
        with self._tasks_lock:
            tasks = list(self._tasks)
        for task, _, _ in tasks:
            if not task.executing() and not task.done():
                task()
        with self._tasks_lock:
            self._tasks = [item for item in self._tasks if not item[0].done() and not item[0].cancelled()]
        for task, _, _ in tasks:
            if task.done() and not task.cancelled() and task.exception() is not None:
                raise task.exception()


def _ready(entities: list[Any], pointers: Any) -> list[Any]:
    return [entity for entity in entities if entity.handle.pointer in pointers] if pointers else []


class _Entities:
    """What the nodes of an executor wait for, as lists that stay until something is added or removed."""

    def __init__(self, nodes: list[Node]) -> None:
        self.subscriptions = [item for node in nodes for item in node.subscriptions]
        self.timers = [item for node in nodes for item in node.timers]
        self.services = [item for node in nodes for item in node.services]
        self.clients = [item for node in nodes for item in node.clients]
        self.guards = [item for node in nodes for item in node.guards]
        self.waitables = [item for node in nodes for item in node.waitables]

    def all(self) -> list[Any]:
        return [item for name in _LIST_NAMES for item in getattr(self, name)]

    def remove(self, entity: Any) -> None:
        for name in _LIST_NAMES:
            if entity in getattr(self, name):
                getattr(self, name).remove(entity)

    def counts(self, extra_guards: int) -> tuple[int, int, int, int, int, int]:
        counts = [
            len(self.subscriptions),
            len(self.guards) + extra_guards,
            len(self.timers),
            len(self.clients),
            len(self.services),
            0,
        ]
        for waitable in self.waitables:
            extra = waitable.get_num_entities()
            for index, name in enumerate(_COUNT_NAMES):
                counts[index] += getattr(extra, name)
        return tuple(counts)  # type: ignore[return-value]

    def changed(self, nodes: list[Node]) -> bool:
        now = _Entities(nodes)
        return any(getattr(self, name) != getattr(now, name) for name in _LIST_NAMES)


_COUNT_NAMES = ("num_subscriptions", "num_guard_conditions", "num_timers", "num_clients", "num_services", "num_events")
_LIST_NAMES = ("subscriptions", "timers", "services", "clients", "guards", "waitables")
