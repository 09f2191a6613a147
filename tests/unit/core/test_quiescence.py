"""Detection of work in progress inside this process."""

from __future__ import annotations

import socket
import threading

import pytest

from robot_stack.core import quiescence
from robot_stack.core.quiescence import others_asleep
from tests.support.waiting import wait_for


def test_a_datagram_in_a_socket_is_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quiescence, "_threads_sleep", lambda: True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver, socket.socket(type=socket.SOCK_DGRAM) as sender:
        receiver.bind(("127.0.0.1", 0))
        assert others_asleep()
        sender.sendto(b"message", receiver.getsockname())
        assert not others_asleep()
        receiver.recv(100)
        assert others_asleep()


def test_datagrams_of_other_processes_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    full = "  1: 00000000:1D2B 00000000:0000 07 00000000:00000900 00:00000000 00000000 0 0 {} 2 0 0\n"
    monkeypatch.setattr(quiescence, "_table", lambda _: [full.format(1)])  # no socket has the inode 1
    assert not quiescence._datagrams_wait()


def test_a_thread_that_runs_or_would_run_is_on_its_way() -> None:
    """A thread that never sleeps is in state R, with or without a processor, so this is deterministic at any load."""
    ended = threading.Event()

    def spin() -> None:
        while not ended.is_set():
            sum(range(1000))

    def sees_it() -> bool:
        return not quiescence._threads_sleep()

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        wait_for(sees_it, "the busy thread")
    finally:
        ended.set()
        thread.join()
    sleeper = threading.Thread(target=ended.wait)
    sleeper.start()
    wait_for(quiescence._threads_sleep, "all threads to sleep")
    sleeper.join()
