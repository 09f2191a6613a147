"""The system's slack of sleeps, read back."""

from __future__ import annotations

import ctypes
import sys
import threading

import pytest

from robot_stack.core.pacing import sharpen_sleep

_PR_GET_TIMERSLACK = 30


@pytest.mark.skipif(sys.platform != "linux", reason="a setting of Linux")
def test_sleeps_of_the_calling_thread_are_sharp():
    seen: list[tuple[bool, int]] = []

    def ask() -> None:
        done = sharpen_sleep()
        seen.append((done, ctypes.CDLL(None).prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)))

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    assert seen == [(True, 1)]


def test_systems_without_the_setting_say_so(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    assert sharpen_sleep() is False
