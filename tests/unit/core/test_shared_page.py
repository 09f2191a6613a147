"""Data that processes share in memory."""

from __future__ import annotations

import math
import os
import threading
import time
from pathlib import Path

import pytest

from robot_stack.core import node_record
from robot_stack.core.node_record import Heartbeats, NodeRecord, NodeRecords
from robot_stack.core.shared_page import SharedPage
from robot_stack.core.world_clock import WorldClock, clock_path
from tests.support.waiting import wait_for


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))
    return tmp_path


class TestPage:
    def test_shared_page_values_and_text_are_read_by_other_reader(self, tmp_path: Path) -> None:
        writer = SharedPage(tmp_path / "page", 2, 1, 16, create=True)
        reader = SharedPage(tmp_path / "page", 2, 1, 16, create=False)
        with writer.writing() as words:
            words[0], words[1] = -5, 2**62
            writer.text = "räder"
        assert reader.read() == (-5, 2**62)
        assert reader.text == "räder"
        writer.set_single(0, 7)
        assert reader.single(0) == 7
        writer.text = "abcdefghijklmnäöü"
        assert reader.text.startswith("abcdefghijklmn")
        reader.close()

    def test_a_page_that_is_missing_or_being_made(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError):
            SharedPage(tmp_path / "page", 1, create=False)
        (tmp_path / "page").write_bytes(b"\0" * 8)
        with pytest.raises(FileNotFoundError, match="being created"):
            SharedPage(tmp_path / "page", 1, create=False)

    def test_unfinished_write_shows_previous_values(self, tmp_path: Path) -> None:
        """If a writer is preempted, readers must not see its half-written values."""
        writer = SharedPage(tmp_path / "page", 2, create=True)
        for number in (1, 2, 3):
            before = writer.read()
            with writer.writing() as words:
                words[0] = number
                assert SharedPage(tmp_path / "page", 2, create=False).read() == before
                words[1] = number
            assert SharedPage(tmp_path / "page", 2, create=False).read() == (number, number)
        words = writer.writing().__enter__()
        words[0] = 9  # the writer dies
        assert SharedPage(tmp_path / "page", 2, create=False).read() == (3, 3)
        with SharedPage(tmp_path / "page", 2, create=True).writing() as words:
            assert tuple(words) == (3, 3)
            words[1] = 4
        assert writer.read() == (3, 4)

    def test_a_writing_that_fails_changes_nothing(self, tmp_path: Path) -> None:
        page = SharedPage(tmp_path / "page", 2, create=True)
        with pytest.raises(ValueError, match="invalid value"), page.writing() as words:
            words[0], words[1] = 1, 2**64
        assert page.read() == (0, 0)

    def test_a_reader_never_mixes_two_writings(self, tmp_path: Path) -> None:
        writer = SharedPage(tmp_path / "page", 4, create=True)
        reader = SharedPage(tmp_path / "page", 4, create=False)
        end = threading.Event()

        def write() -> None:
            number = 0
            while not end.is_set():
                number += 1
                with writer.writing() as words:
                    for index in range(4):
                        words[index] = number

        thread = threading.Thread(target=write)
        thread.start()
        try:
            for _ in range(5000):
                assert len(set(reader.read())) == 1
        finally:
            end.set()
            thread.join()


class TestWorldClock:
    def test_world_clock_is_absent_without_world(self) -> None:
        assert WorldClock.find() is None
        world = WorldClock.make()
        assert (world.now_ns(), world.speed, world.pace) == (0, 1.0, 0.0)
        world.write(1.0, 0.001, 2.5)
        world.write_pace(0.7)
        other = WorldClock.find()
        assert other is not None
        assert (other.speed, other.pace) == (2.5, 0.7)
        WorldClock.remove()
        assert not clock_path().exists()
        assert WorldClock.find() is None

    def test_it_runs_on_within_a_step_and_never_beyond(self) -> None:
        clock = WorldClock.make()
        clock.write(10.0, 0.002, 1.0)
        assert 10.0 <= clock.now_s() <= 10.002
        wait_for(lambda: clock.now_s() >= 10.002, "the end of the step")
        assert clock.now_s() == pytest.approx(10.002, abs=1e-12)

    def test_it_does_not_go_back(self) -> None:
        world, clock = WorldClock.make(), WorldClock.find()
        assert clock is not None
        world.write(10.0, 0.0, 1.0)
        assert clock.now_s() == 10.0
        world.write(9.99, 0.0, 1.0)
        assert clock.now_s() == 10.0
        world.write(10.01, 0.0, 1.0)
        assert clock.now_s() == pytest.approx(10.01)
        world.write(5.0, 0.0, 1.0)
        assert clock.now_s() == 5.0, "unless it is set back"


class TestNodeRecord:
    def test_construction_and_life(self) -> None:
        begun_s = time.monotonic()
        records = NodeRecords()
        assert node_record.names() == []
        assert records.read("a") is None
        record = NodeRecord("a")
        assert records.read("a") is None, "nothing has been said yet"
        record.constructing("compiling")
        state = records.read("a")
        assert state is not None
        assert (state.pid, state.beats, state.ready, state.text) == (os.getpid(), 0, False, "compiling")
        record.beat(False, "/odom")
        record.beat(True, "driving")
        state = records.read("a")
        assert state is not None
        assert (state.beats, state.ready, state.text) == (2, True, "")
        assert begun_s <= state.beat_s <= time.monotonic()
        assert node_record.names() == ["a"]

    def test_due_time_of_node_records(self) -> None:
        record, records = NodeRecord("a"), NodeRecords()
        record.constructing("imports")
        assert records.due_s("a") == math.inf
        record.due(12.5)
        assert records.due_s("a") == pytest.approx(12.5)
        record.due(math.inf)
        assert records.due_s("a") == math.inf
        assert records.due_s("b") == math.inf

    def test_only_new_heartbeats_count(self) -> None:
        record = NodeRecord("a")
        early = Heartbeats(["a"])
        record.constructing("imports")
        assert early.new() == []
        record.beat(True, "")
        heartbeats = Heartbeats(["a", "b"])
        assert heartbeats.new() == [], "it may have died long ago"
        assert heartbeats.new() == []
        record.beat(True, "")
        assert heartbeats.new() == ["a"]
        assert heartbeats.new() == []
