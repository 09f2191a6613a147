"""Ends connections that never become a request or a page: a few dozen of them would block all pages."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Collection
from typing import Any

_LOOKS_A_LIMIT = 4


class Connections:
    """limit_s: lifetime of a connection. present: the server's own list, as uvicorn keeps it.

    pages: addresses (host, port) of pages, whose connections stay.
    """

    def __init__(self, limit_s: float, present: Callable[[], Collection[Any]]) -> None:
        self._limit_s, self._present = limit_s, present
        self.pages: set[tuple[str, int]] = set()

    async def watch(self) -> None:
        """Until it is cancelled."""
        since: dict[Any, float] = {}
        while True:
            await asyncio.sleep(self._limit_s / _LOOKS_A_LIMIT)
            now_s = time.monotonic()
            since = {item: since.get(item, now_s) for item in self._present()}
            for item, at_s in since.items():
                if now_s - at_s > self._limit_s and item.client not in self.pages:
                    item.transport.abort()
