"""Log lines of nodes, in virtual time."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class LogLine:
    """time_ns: virtual. level: DEBUG, INFO, WARN, ERROR or FATAL."""

    time_ns: int
    node: str
    level: str
    text: str


class SimLogger:
    """See ``robot_stack.middleware.port.Logger``; the options of rclpy's that limit the calls of one code line."""

    def __init__(self, node: str, now_ns: Callable[[], int], write: Callable[[LogLine], None]) -> None:
        self._node, self._now_ns, self._write = node, now_ns, write
        self._last_ns: dict[tuple[str, int], int] = {}
        self._once: set[tuple[str, int]] = set()

    def debug(self, message: str, **options: Any) -> bool:
        return self._log("DEBUG", message, options)

    def info(self, message: str, **options: Any) -> bool:
        return self._log("INFO", message, options)

    def warning(self, message: str, **options: Any) -> bool:
        return self._log("WARN", message, options)

    def error(self, message: str, **options: Any) -> bool:
        return self._log("ERROR", message, options)

    def fatal(self, message: str, **options: Any) -> bool:
        return self._log("FATAL", message, options)

    warn = warning

    def _log(self, level: str, message: str, options: dict[str, Any]) -> bool:
        if options and not self._passes(options):
            return False
        self._write(LogLine(self._now_ns(), self._node, level, str(message)))
        return True

    def _passes(self, options: dict[str, Any]) -> bool:
        caller = sys._getframe(3)  # _passes, _log, the level's method, the caller
        line = caller.f_code.co_filename, caller.f_lineno
        if options.get("once"):
            first = line not in self._once
            self._once.add(line)
            return first
        throttle_s = options.get("throttle_duration_sec")
        now_ns, last_ns = self._now_ns(), self._last_ns.get(line)
        if options.get("skip_first") and last_ns is None:
            self._last_ns[line] = now_ns
            return False
        if throttle_s is not None and last_ns is not None and now_ns - last_ns < 1e9 * float(throttle_s):
            return False
        self._last_ns[line] = now_ns
        return True
