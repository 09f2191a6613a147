"""A single-threaded executor that wakes for urgent entities and timers, and reads all others at each wake-up.

rclpy's own executor builds a wait set, a task and several guard-condition triggers for every callback, and rmw attaches
every entity of the set again at each wait: together 0.3-0.7 ms of processor time a wake-up on a small machine, several
hundred times a second. This one sleeps in one ``epoll`` (``robot_stack.ros.wakeups``) until an urgent message, a
service call, an action or the next timer is due. Messages that do not wake the node (``StackNode.subscribe``) are read
then. Coroutines and actions still run as rclpy tasks.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

from rclpy.client import Client
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.waitable import Waitable

from robot_stack.ros.rcl_timers import RclTimers
from robot_stack.ros.wakeups import Wakeups, can_follow

# Longest wait, reached only without any timer.
_LONGEST_WAIT_S = 1.0
# A wait that ends this much late indicates that the process stalled (a busy or paused machine) and could not receive
# messages.
_PAUSE_S = 0.03
# Polling period of a coroutine that waits for something outside this executor's entities.
_TASK_POLL_S = 0.02
# Period of checks for events without a wake-up in rcl (QoS events, goals of an action that expire).
_SLOW_CHECK_S = 5.0


class LeanExecutor(Executor):
    """Runs the callbacks of its nodes in the thread that spins."""

    def __init__(self, *, context: Any = None) -> None:
        self._wakeups = Wakeups()
        super().__init__(context=context)
        self._tasks: list[Any] = self._tasks  # rclpy's list; declared here for the type checker
        self._entities = _Entities([])
        # Followed handles stay alive until they are released, even if another thread destroys their entity.
        self._held: dict[int, tuple[Any, ExitStack]] = {}
        self._slow_check_s = 0.0
        self._stop = self._closed = False
        self._awake = False

    # --- spinning ----------------------------------------------------------------------------------------------------

    def spin(self, should_stop: Callable[[], bool] = lambda: False) -> None:
        """Runs callbacks until ``should_stop`` returns True or ``stop`` is called. Raises ExternalShutdownException.

        ``should_stop`` is called after each wake-up; call ``wake`` when its result changes. A ``stop`` before the
        start counts: its caller cannot know whether the spinning thread has begun.
        """
        while not self._stop and not should_stop():
            self.spin_once(None)

    def stop(self) -> None:
        """Ends ``spin`` soon and for good; may be called from any thread."""
        self._stop = True
        self.wake()

    def wake(self) -> None:
        """Ends a wait; may be called from any thread and from a signal handler."""
        if not self._closed:
            self._wakeups.wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        self._run_tasks()
        if not self._context.ok():
            raise ExternalShutdownException()
        for node in self._entities.stack_nodes:
            node.before_wait()
        timeout_s = self._timeout_s(timeout_sec)
        start_s = time.monotonic()
        self._awake = False
        woken, ready = self._wakeups.wait(timeout_s)
        self._awake = True
        late_s = time.monotonic() - start_s - timeout_s
        if late_s > _PAUSE_S:
            self._report_pause(late_s)
        for node in self._entities.stack_nodes:
            node.after_wait()
        if woken:
            self._follow_changes()
        self._dispatch(woken, ready)

    def idle(self) -> bool:
        """True if it sleeps and nothing that would wake it has arrived. For other threads."""
        return not self._awake and not self._wakeups.pending()

    def add_node(self, node: Node) -> bool:
        added = bool(super().add_node(node))
        self.wake()
        return added

    def remove_node(self, node: Node) -> None:
        super().remove_node(node)
        self.wake()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Any:
        task = super().create_task(callback, *args, **kwargs)
        self.wake()
        return task

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        if not self._closed:
            self._closed = True
            self._forget(list(self._held))
            self._wakeups.close()
        return bool(super().shutdown(timeout_sec))

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        future.add_done_callback(lambda _: self.wake())
        seconds = getattr(timeout_sec, "timeout", timeout_sec)
        if not future.done():
            self.spin_once(seconds)

    # --- waiting -----------------------------------------------------------------------------------------------------

    def _timeout_s(self, asked_s: float | None) -> float:
        due_s = min((schedule.wait_s() for schedule in self._entities.schedules), default=math.inf)
        limits = [due_s, _LONGEST_WAIT_S, *([_TASK_POLL_S] if self._tasks else [])]
        if asked_s is not None and asked_s >= 0.0:
            limits.append(asked_s)
        return max(0.0, min(limits))

    def _report_pause(self, late_s: float) -> None:
        for node in self.get_nodes():
            on_pause = getattr(node, "on_pause", None)
            if on_pause is not None:
                on_pause(late_s)

    # --- entities ----------------------------------------------------------------------------------------------------

    def _follow_changes(self) -> None:
        """Wakes for entities added since the last call, no longer for removed ones."""
        now = _Entities(self.get_nodes())
        if now.same(self._entities):
            return
        self._entities = now
        wanted = {id(entity): entity for entity in now.followed}
        self._forget([key for key in self._held if key not in wanted])
        for key, entity in wanted.items():
            if key not in self._held:
                self._hold(entity)

    def _hold(self, entity: Any) -> None:
        stack = ExitStack()
        try:
            stack.enter_context(entity if isinstance(entity, Waitable) else entity.handle)
        except InvalidHandle:  # being destroyed by another thread: its wake-up is on the way
            return
        self._held[id(entity)] = entity, stack
        self._wakeups.follow(entity)

    def _forget(self, keys: list[int]) -> None:
        for key in keys:
            entity, stack = self._held.pop(key)
            self._wakeups.forget([entity])
            stack.close()

    # --- callbacks ---------------------------------------------------------------------------------------------------

    def _dispatch(self, woken: bool, ready: list[tuple[Any, int]]) -> None:
        """Messages before timers, so that a tick uses what has already arrived.

        A wait on a simulated clock may end before the timer is due: then there is nothing to do.
        """
        if time.monotonic() >= self._slow_check_s:
            self._slow_check_s = time.monotonic() + _SLOW_CHECK_S
            self._start_ready(self._entities.waitables)
        if not (woken or ready or any(schedule.ready() for schedule in self._entities.schedules)):
            return
        for entity, count in ready:
            self._take(entity, count)
        for subscription in self._entities.polled:
            self._take_messages(subscription)
        for node in self._entities.stack_nodes:
            node.on_taken()
        for schedule in self._entities.schedules:
            for callback in schedule.due():
                self._call(callback)

    def _take(self, entity: Any, count: int) -> None:
        match entity:
            case Subscription():
                self._take_messages(entity)
            case Service():
                for _ in range(count):
                    self._run(self._take_service(entity))
            case Client():
                for _ in range(count):
                    self._run(self._take_client(entity))
            case _:
                while self._start_ready([entity]):
                    pass

    def _take_messages(self, subscription: Any) -> None:
        """Reads the messages that have arrived, oldest first.

        There are at most ``depth``, as the history is KEEP_LAST. Those that arrive meanwhile are read at the next
        wake-up: a publisher that is faster than the callback leaves turns to the timers and the other topics.
        """
        handle, raw, message_type = subscription.handle, subscription.raw, subscription.msg_type
        only_message = subscription._callback_type is Subscription.CallbackType.MessageOnly
        for _ in range(max(1, subscription.qos_profile.depth)):
            try:
                taken = handle.take_message(message_type, raw)
            except (InvalidHandle, _rclpy.RCLError):
                if self._has(subscription):
                    raise
                return  # destroyed by an earlier callback
            if taken is None:
                return
            if only_message:
                self._call(subscription.callback, taken[0])
            else:
                self._call(subscription.callback, *taken)

    def _has(self, subscription: Any) -> bool:
        return any(item is subscription for node in self.get_nodes() for item in node.subscriptions)

    def _start_ready(self, waitables: list[Waitable]) -> bool:
        """Starts the ready entities, found by a wait of zero length. True if there were any."""
        with ExitStack() as held:
            alive = []
            for waitable in waitables:
                with suppress(InvalidHandle):
                    held.enter_context(waitable)
                    alive.append(waitable)
            if not alive:
                return False
            held.enter_context(self._context.handle)
            wait_set = _rclpy.WaitSet(*_counts(alive), self._context.handle)
            wait_set.clear_entities()
            for waitable in alive:
                waitable.add_to_wait_set(wait_set)
            wait_set.wait(0)
            ready = [waitable for waitable in alive if waitable.is_ready(wait_set)]
        for waitable in ready:
            data = waitable.take_data()
            for future in waitable._futures:
                future._set_executor(self)
            self._finish(waitable.execute(data))
        return bool(ready)

    def _run(self, coroutine_function: Callable[[], Any] | None) -> None:
        if coroutine_function is not None:
            self._finish(coroutine_function())

    def _call(self, callback: Callable[..., Any], *args: Any) -> None:
        result = callback(*args)
        if inspect.iscoroutine(result):
            self._finish(result)

    def _finish(self, coroutine: Any) -> None:
        """Runs a coroutine; one that waits continues as a task."""
        task = super().create_task(coroutine)
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


class _Entities:
    """Entities of an executor's nodes, as lists that stay until something is added or removed."""

    def __init__(self, nodes: list[Node]) -> None:
        self.stack_nodes = [node for node in nodes if hasattr(node, "taken_at_tick")]
        taken_at_tick = {id(item) for node in self.stack_nodes for item in node.taken_at_tick}
        subscriptions = [item for node in nodes for item in node.subscriptions]
        self.polled = [item for item in subscriptions if id(item) in taken_at_tick]
        urgent = [item for item in subscriptions if id(item) not in taken_at_tick]
        services = [item for node in nodes for item in node.services]
        clients = [item for node in nodes for item in node.clients]
        self.waitables = [item for node in nodes for item in node.waitables]
        actions = [item for item in self.waitables if can_follow(item)]
        self.followed = [*urgent, *services, *clients, *actions]
        self._timers = [item for node in nodes for item in node.timers]
        self.schedules: list[Any] = [item for node in self.stack_nodes for item in node.schedules]
        if self._timers:
            self.schedules.append(RclTimers(self._timers))

    def same(self, other: _Entities) -> bool:
        return (
            self.followed == other.followed
            and self.polled == other.polled
            and self.waitables == other.waitables
            and self._timers == other._timers
            and self.stack_nodes == other.stack_nodes
        )


def _counts(waitables: list[Waitable]) -> list[int]:
    extra = [waitable.get_num_entities() for waitable in waitables]
    return [sum(getattr(item, name) for item in extra) for name in _COUNT_NAMES]


_COUNT_NAMES = (
    "num_subscriptions",
    "num_guard_conditions",
    "num_timers",
    "num_clients",
    "num_services",
    "num_events",
)
