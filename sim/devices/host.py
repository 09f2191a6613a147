"""The host at the other end of a wire: whether it has read what a simulated device has sent."""

from __future__ import annotations

import time
from collections.abc import Callable

_FIRST_LOOK_S, _LAST_LOOK_S = 0.0001, 0.002
_PATIENCE_S = 10.0  # a host that reads nothing for so long has ended or hangs


def wait_read(unread: Callable[[], int]) -> bool:
    """Waits until ``unread`` returns 0. False for a host that does not read.

    A simulated device that waits keeps its world from going on, so that a driver without processor time is no silent
    device.
    """
    end_s, look_s = time.monotonic() + _PATIENCE_S, _FIRST_LOOK_S
    while unread():
        if time.monotonic() > end_s:
            return False
        time.sleep(look_s)
        look_s = min(2.0 * look_s, _LAST_LOOK_S)
    return True
