"""Whether work is pending inside this process: running threads or unread datagrams. Source: proc(5)."""

from __future__ import annotations

import os
import threading

# States of a thread that sleeps until an event. Any other state runs, is runnable, or waits for a disk.
_SLEEPING = ("S", "I")


def others_asleep() -> bool:
    """True if every other thread of this process sleeps and none of its UDP sockets holds a datagram.

    A datagram in flight is in a socket, a thread that waits for its turn is runnable: both at any load. One call may
    meet a thread between two steps; call several times in a row.
    """
    return _threads_sleep() and not _datagrams_wait()


def _threads_sleep() -> bool:
    own = str(threading.get_native_id())
    for thread in os.listdir("/proc/self/task"):
        if thread == own:
            continue
        try:
            with open(f"/proc/self/task/{thread}/stat", encoding="utf-8", errors="replace") as file:
                state = file.read().rpartition(")")[2].split()[0]
        except OSError:  # it has just ended
            continue
        if state not in _SLEEPING:
            return False
    return True


def _datagrams_wait() -> bool:
    inodes = set()
    for descriptor in os.listdir("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{descriptor}")
        except OSError:
            continue
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    return any(_holds_datagram(line, inodes) for table in ("udp", "udp6") for line in _table(table))


def _table(name: str) -> list[str]:
    try:
        with open(f"/proc/self/net/{name}", encoding="ascii") as file:
            return file.readlines()[1:]
    except OSError:  # a kernel without this protocol
        return []


def _holds_datagram(line: str, inodes: set[str]) -> bool:
    """Fields: number, local and remote address, state, tx_queue:rx_queue, ..., inode at the tenth place."""
    fields = line.split()
    return fields[9] in inodes and int(fields[4].partition(":")[2], 16) > 0
