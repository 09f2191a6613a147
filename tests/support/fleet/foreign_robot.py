"""A robot by a foreign implementation of VDA 5050 2.1 (vda5050-sdk): it drives where orders lead, node by node."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

from vda5050.client.agv.client import VehicleClient
from vda5050.client.agv.executor import OrderExecutor
from vda5050.config import VehicleConfig
from vda5050.model.order import Node, Order

from tests.support.waiting import wait_for

MAKER = "foreign"


class ForeignRobot:
    """Runs in its own thread, at ``node`` of the map ``yard``. waits: before each further node for ``release``."""

    def __init__(
        self, url: str, serial: str, *, node: str = "start", waits: bool = False, state_interval_s: float = 0.2
    ) -> None:
        self._config = VehicleConfig(
            broker_url=url, manufacturer=MAKER, serial_number=serial, client_id=serial, state_interval=state_interval_s
        )
        self._node, self._waits = node, waits
        self.orders: list[str] = []
        self._loop = asyncio.new_event_loop()
        self._gate = asyncio.Semaphore(0)
        self._order: asyncio.Task[Any] | None = None
        self._ready, self._stop = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(self._run(),), daemon=True)
        self._thread.start()
        wait_for(self._ready.is_set, f"robot {serial} at {url}")

    def release(self) -> None:
        """Lets it drive to the next node."""
        self._call(self._gate.release)

    def lose(self) -> None:
        """Its process dies: the broker publishes its last will."""

        def cut() -> None:
            client: Any = self.client._transport
            client._client._client.socket().close()

        self._call(cut)

    def close(self) -> None:
        self._call(self._stop.set)
        self._thread.join(30.0)
        self._loop.close()

    def _call(self, function: Callable[[], None]) -> None:
        self._loop.call_soon_threadsafe(function)

    async def _run(self) -> None:
        self.client = VehicleClient(self._config)
        self.client.on_order(self._drive)
        self.client.on_instant_actions(self._cancelled)
        await self.client.connect()
        publisher = self.client.publisher
        publisher.update_position(x=1.0, y=2.0, theta=0.0, map_id="yard")
        publisher.mark_node_traversed(self._node, 0)
        await self.client.publish_state()
        self._ready.set()
        await self._stop.wait()
        if self._order is not None:
            self._order.cancel()
        await self.client.disconnect()

    def _drive(self, order: Order) -> None:
        self.orders.append(order.order_id)
        executor = _Executor(self.client.publisher)
        executor.gate = self._gate if self._waits else None
        # A task: the client receives nothing while it awaits this callback.
        self._order = asyncio.ensure_future(executor.run(order))

    def _cancelled(self, message: Any) -> None:
        if self._order is not None and any(action.action_type == "cancelOrder" for action in message.actions):
            self._order.cancel()


class _Executor(OrderExecutor):
    gate: asyncio.Semaphore | None = None

    async def visit_node(self, node: Node) -> None:
        if self.gate is not None:
            await self.gate.acquire()
        await super().visit_node(node)
