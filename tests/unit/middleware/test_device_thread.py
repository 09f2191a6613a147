"""The thread of a device on pipes: reads, reports a loss, pauses, reopens, and ends from every wait."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import pytest

from robot_stack.middleware.device_thread import DeviceLost, DeviceThread, reason
from tests.support.waiting import wait_for

HOUR_S = 3600.0


class LibraryError(Exception):
    pass


class Pipe:
    """A device that delivers the bytes of a pipe; an ended pipe is a loss."""

    where = "pipe"

    def __init__(self, lost: Exception | None = None) -> None:
        self.lost, self.got, self.uses = lost, b"", 0
        self._read, self.end = os.pipe()

    def use(self, thread: DeviceThread) -> None:
        self.uses += 1
        if self.lost is not None:
            raise self.lost
        thread.report_open()
        while thread.running:
            if thread.wait(None, self._read):
                data = os.read(self._read, 100)
                if not data:
                    raise DeviceLost("has ended")
                self.got += data


@pytest.fixture
def start() -> Iterator[Callable[[Pipe, float], DeviceThread]]:
    threads = []

    def start(device: Pipe, reopen_s: float) -> DeviceThread:
        threads.append(DeviceThread(device, reopen_s))
        return threads[-1]

    yield start
    for thread in threads:
        thread.close()
        thread.close()
        thread.wake()


def test_reads_until_it_is_closed(start: Callable[[Pipe, float], DeviceThread]) -> None:
    device = Pipe()
    thread = start(device, HOUR_S)
    os.write(device.end, b"one")
    wait_for(lambda: device.got == b"one", "the bytes")
    thread.wake()  # without data
    os.write(device.end, b"two")
    wait_for(lambda: device.got == b"onetwo", "the bytes after a wake")
    assert (thread.state, thread.opened) == ("pipe is open", 1)


@pytest.mark.parametrize(
    ("lost", "state"),
    [
        (DeviceLost("sends no frames"), "pipe sends no frames"),
        (FileNotFoundError(2, "No such file", "/dev/nothing"), "pipe: No such file or directory"),
        (ValueError("not a baud rate: 7"), "pipe: not a baud rate: 7"),
        (LibraryError("bus off"), "pipe: LibraryError: bus off"),
    ],
)
def test_loss_is_reported_and_not_retried_before_the_pause(
    start: Callable[[Pipe, float], DeviceThread], lost: Exception, state: str
) -> None:
    device = Pipe(lost)
    thread = start(device, HOUR_S)
    wait_for(lambda: thread.state == state, "the loss")
    thread.wake()  # does not shorten the pause
    thread.close()
    assert (device.uses, thread.opened) == (1, 0)


def test_device_that_ends_at_once_is_reopened_after_each_pause(start: Callable[[Pipe, float], DeviceThread]) -> None:
    device = Pipe()
    os.close(device.end)
    thread = start(device, 0.001)
    wait_for(lambda: thread.opened >= 3, "three openings")
    wait_for(lambda: thread.state == "pipe has ended", "the loss")


def test_device_of_a_failed_open_is_used_once_it_is_there(start: Callable[[Pipe, float], DeviceThread]) -> None:
    device = Pipe(FileNotFoundError(2, "No such file"))
    thread = start(device, 0.001)
    wait_for(lambda: device.uses >= 2, "a second try")
    device.lost = None
    wait_for(lambda: thread.state == "pipe is open", "the device")


def test_exception_of_a_library_is_logged_once_and_the_device_is_reopened(
    start: Callable[[Pipe, float], DeviceThread], caplog: pytest.LogCaptureFixture
) -> None:
    device = Pipe(LibraryError("bus off"))
    thread = start(device, 0.001)
    wait_for(lambda: device.uses >= 3, "two more tries")
    device.lost = None
    wait_for(lambda: thread.state == "pipe is open", "the device")
    assert caplog.messages == ["pipe: LibraryError: bus off; the device is reopened"]


def test_loss_of_the_device_precedes_a_problem_of_its_data(start: Callable[[Pipe, float], DeviceThread]) -> None:
    device = Pipe()
    thread = start(device, HOUR_S)
    wait_for(lambda: thread.is_open, "the device")
    assert thread.problem("a frame is cut off") == "a frame is cut off"
    assert thread.problem("") == "pipe is open"
    os.close(device.end)
    wait_for(lambda: not thread.is_open, "the loss")
    assert thread.problem("a frame is cut off") == "pipe has ended"


def test_reason_of_an_error() -> None:
    assert reason(OSError(5, "anything", "/dev/x")) == "Input/output error"
    assert reason(OSError("no number")) == "no number"
