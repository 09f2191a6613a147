"""Status in shared memory: never torn, never undetectably old, cheap to read."""

from __future__ import annotations

import multiprocessing
import struct
import time
from collections.abc import Iterator
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
import pytest

from robot_stack.wmx.api import EngineState
from robot_stack.wmx.axes import axis_feedback, empty_snapshot
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.status_writer import StatusWriter
from robot_stack.wmx.engine_server.virtual_drives import VirtualDrives
from robot_stack.wmx.simulated.channel import StatusView
from robot_stack.wmx.simulated.status_memory import (
    STATUS_FILE,
    StatusReader,
    StatusUnreadable,
)
from tests.support.waiting import wait_for
from tests.unit.wmx.harness import N_AXES, axis_kind, engine_config, runtime_folder

_SEQUENCE_AT = 56


@pytest.fixture
def folder() -> Iterator[Path]:
    with runtime_folder() as folder:
        yield folder


def make_engine(n_axes: int = N_AXES) -> Engine:
    if n_axes == N_AXES:
        return Engine(engine_config(), VirtualDrives(N_AXES, 0.001))
    axes = [{"name": f"axis {index}", "kind": "any"} for index in range(n_axes)]
    config = engine_config(kinds={"any": axis_kind()}, axes=axes, n_input_bytes=8000, n_output_bytes=8000)
    return Engine(config, VirtualDrives(n_axes, 0.001))


def hammer(folder: Path, n_axes: int, checked: bool, go: Event, stop: Event) -> None:
    """Publishes as fast as possible. All fields of one publication contain the same number."""
    engine = make_engine(n_axes)
    writer = StatusWriter(engine, folder, checked)
    count = 0
    gap_ns = 400 * n_axes  # about a reader's copy time, so that readers meet both gaps and writes
    while not stop.is_set():
        for _ in range(200):
            count += 1
            engine.condition.cycles = count
            engine.arrays.reals[:] = count
            engine.arrays.flags[:] = count
            engine.feedback.inputs[:] = count % 251
            engine.commands.outputs[:] = count % 251
            writer.publish(count)
            gap_ends_ns = time.perf_counter_ns() + gap_ns
            while time.perf_counter_ns() < gap_ends_ns:
                pass
        go.set()


@pytest.mark.parametrize(("n_axes", "checked"), [(N_AXES, False), (128, True)], ids=["plain", "checksum"])
def test_never_torn(folder: Path, n_axes: int, checked: bool) -> None:
    context = multiprocessing.get_context("spawn")
    go, stop = context.Event(), context.Event()
    process = context.Process(target=hammer, args=(folder, n_axes, checked, go, stop))
    process.start()
    try:
        assert go.wait(60.0)
        reader = StatusReader(folder)
        seen = set()
        begun_s = time.monotonic()
        while len(seen) < 1000 and time.monotonic() < begun_s + (5.0 if len(seen) >= 200 else 90.0):
            try:
                snapshot = reader.read()
            except StatusUnreadable:  # the writer was preempted for long while writing: not torn
                continue
            number = snapshot.cycle_counter
            assert snapshot.stamp_ns == number
            assert (snapshot.reals == number).all()
            assert (snapshot.flags == number).all()
            assert (snapshot.inputs == number % 251).all()
            assert (snapshot.outputs == number % 251).all()
            seen.add(number)
            try:
                feedback = reader.read_feedback()
            except StatusUnreadable:
                continue
            number = feedback.cycle_counter
            assert feedback.stamp_ns == number
            assert feedback.position == feedback.velocity == (float(number),) * n_axes
            assert set(feedback.outputs) == {number % 251}
        assert len(seen) >= 200, "the writer was not at work while it was read"
    finally:
        stop.set()
        process.join(30.0)
        if process.is_alive():
            process.kill()
            process.join()


def test_status_memory_round_trip(folder: Path) -> None:
    engine = make_engine()
    writer = StatusWriter(engine, folder)
    engine.condition.state = EngineState.Communicating
    engine.condition.cycles = 77
    engine.condition.emergency_stop = True
    engine.condition.overruns = 3
    engine.arrays.reals[:] = np.arange(engine.arrays.reals.size).reshape(engine.arrays.reals.shape)
    engine.arrays.flags[:] = np.arange(engine.arrays.flags.size).reshape(engine.arrays.flags.shape)
    engine.feedback.inputs[:] = [1, 2, 3, 4]
    engine.commands.outputs[:] = [5, 6, 7, 8]
    assert StatusReader(folder).read().age_s(time.monotonic_ns()) == float("inf"), "nothing is published yet"
    writer.publish(123456789)
    snapshot = StatusReader(folder).read()
    assert snapshot.engine_state is EngineState.Communicating
    assert snapshot.communicating
    assert (snapshot.cycle_counter, snapshot.stamp_ns, snapshot.overruns) == (77, 123456789, 3)
    assert snapshot.engine_time_s == pytest.approx(0.077)
    assert snapshot.emergency_stop
    assert (snapshot.reals == engine.arrays.reals).all()
    assert (snapshot.flags == engine.arrays.flags).all()
    assert snapshot.inputs.tolist() == [1, 2, 3, 4]
    assert snapshot.outputs.tolist() == [5, 6, 7, 8]
    assert snapshot.age_s(123456789 + 500_000_000) == pytest.approx(0.5)
    before = engine.arrays.reals.copy()
    engine.arrays.reals[:] = 9.0
    writer.publish(2)
    assert (snapshot.reals == before).all(), "it is a copy"
    empty = empty_snapshot(3)
    assert (empty.engine_state, empty.communicating, empty.n_axes) == (EngineState.Unknown, False, 3)
    assert not empty.servo_on.any()


@pytest.mark.parametrize("checked", [False, True], ids=["plain", "checksum"])
def test_axis_feedback_equals_full_status(folder: Path, checked: bool) -> None:
    engine = make_engine()
    writer = StatusWriter(engine, folder, checked)
    engine.condition.cycles = 77
    engine.arrays.reals[:] = np.arange(engine.arrays.reals.size).reshape(engine.arrays.reals.shape)
    engine.commands.outputs[:] = [5, 6, 7, 8]
    reader = StatusReader(folder)
    for state in (EngineState.Running, EngineState.Communicating):
        engine.condition.state = state
        writer.publish(123456789)
        assert reader.read_feedback() == axis_feedback(reader.read())
        assert reader.read_feedback().communicating == (state is EngineState.Communicating)
    assert reader.read_feedback().output_bit(3, 3)
    assert not reader.read_feedback().output_bit(4, 0), "beyond the image"


@pytest.mark.parametrize("contents", [b"", b"short", bytes(400), b"\xff" * 4096])
def test_missing_page_or_page_of_something_else(folder: Path, contents: bytes) -> None:
    with pytest.raises(StatusUnreadable, match="cannot be opened"):
        StatusReader(folder)
    (folder / STATUS_FILE).write_bytes(contents)
    with pytest.raises(StatusUnreadable, match="status page"):
        StatusReader(folder)


def stop_while_writing(folder: Path) -> None:
    """Makes the sequence number odd, as a writer leaves it that stops in the middle."""
    with open(folder / STATUS_FILE, "r+b") as file:
        file.seek(_SEQUENCE_AT)
        (number,) = struct.unpack("<q", file.read(8))
        file.seek(_SEQUENCE_AT)
        file.write(struct.pack("<q", number + 1))


def test_writer_that_died_while_writing(folder: Path) -> None:
    writer = StatusWriter(make_engine(), folder)
    writer.publish(1)
    reader = StatusReader(folder)
    stop_while_writing(folder)
    pauses: list[float] = []
    with pytest.raises(StatusUnreadable, match="died while writing"):
        reader.read(pause=pauses.append)
    with pytest.raises(StatusUnreadable, match="died while writing"):
        reader.read_feedback()
    assert pauses, "a patient reader gives its time slice away"


def test_checksum_refuses_contents_that_do_not_belong_together(folder: Path) -> None:
    """As after another core's reordered stores: an even number, but mixed contents."""
    writer = StatusWriter(make_engine(), folder, checked=True)
    writer.publish(1)
    reader = StatusReader(folder)
    assert reader.read().stamp_ns == 1
    with open(folder / STATUS_FILE, "r+b") as file:
        file.seek(-1, 2)
        file.write(b"\x5a")
    with pytest.raises(StatusUnreadable):
        reader.read(pause=lambda _: None)


def test_view_returns_the_status_before_a_write_that_does_not_end_until_it_is_stale(folder: Path) -> None:
    """A paused simulation must not look like a dead engine."""
    writer = StatusWriter(make_engine(), folder)
    now_ns = time.monotonic_ns()
    writer.publish(now_ns)
    view, hasty, late = (
        StatusView(folder, stale_s=1e6),
        StatusView(folder, stale_s=1e-9),
        StatusView(folder, stale_s=1e6),
    )
    assert view.read()[0] == 0
    assert hasty.read()[0] == 271
    stop_while_writing(folder)
    code, snapshot = view.read()
    assert (code, snapshot.stamp_ns) == (0, now_ns)
    code, snapshot = hasty.read()
    assert (code, snapshot.stamp_ns) == (271, now_ns)
    assert late.read()[0] == 271, "a view without any status"


def test_view_goes_stale_and_finds_the_next_writer(folder: Path) -> None:
    view = StatusView(folder, stale_s=0.05)
    assert view.read()[0] == 282, "no page"
    assert view.read_feedback() is None
    writer = StatusWriter(make_engine(), folder)
    writer.publish(time.monotonic_ns())
    assert view.read()[0] == 0
    assert view.read_feedback() is not None
    wait_for(lambda: view.read()[0] == 271, "the status to go stale")
    assert view.read_feedback() is None
    second = StatusWriter(make_engine(), folder)
    second.publish(time.monotonic_ns())
    assert view.read_feedback() is None, "which page is the present one, a read finds out"
    assert view.read()[0] == 0, "the view maps the new page"
    assert view.read_feedback() is not None
