"""Updates for a page: changed sections only, at a limited rate. Times are steady seconds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


class Changes:
    """The sections of one page: ``offer`` the present state, ``take`` the update to send."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._sent: dict[str, Any] = {}
        self._waiting: dict[str, Any] = {}
        self._sent_s = -math.inf

    def offer(self, sections: Mapping[str, Any]) -> None:
        """Keeps the newest of each section; one that equals the page's state again is dropped."""
        for name, value in sections.items():
            if name in self._sent and self._sent[name] == value:
                self._waiting.pop(name, None)
            else:
                self._waiting[name] = value

    def wait_s(self, now_s: float) -> float:
        """Seconds until the next update may be sent; infinite without one."""
        if not self._waiting:
            return math.inf
        return min(self._period_s, max(0.0, self._sent_s + self._period_s - now_s))

    def take(self, now_s: float) -> dict[str, Any]:
        """The update to send now; empty if nothing changed or it is too early."""
        if self.wait_s(now_s) > 0.0:
            return {}
        taken, self._waiting = self._waiting, {}
        self._sent |= taken
        self._sent_s = now_s
        return taken

    def forget(self, name: str) -> None:
        """The page has dropped a section: it is sent again when it is next offered."""
        self._sent.pop(name, None)
        self._waiting.pop(name, None)
