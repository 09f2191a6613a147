"""The agent dies before, between and after its writes: no order is lost, and none is handed over twice."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from robot_stack.fleet.link import Topic
from robot_stack.fleet.nodes.journal_file import JournalFile
from robot_stack.fleet.record import Phase, Record
from tests.unit.fleet.master import HEADER, Bench, Data, action, node, node_ids, order, statuses


def first_part() -> Data:
    wait = action("wait", "w1", duration=1.0)
    return order([node("a", 0, 0.0), node("b", 2, 2.0, wait), node("c", 4, 4.0), node("d", 6, 6.0, released=False)])


def second_part() -> Data:
    return order([node("c", 4, 4.0), node("d", 6, 6.0, action("wait", "w2", duration=1.0))], update=1)


def _before_write(bench: Bench) -> None:
    bench.compute()


def _before_sending(bench: Bench) -> None:
    bench.compute()
    bench.save()


def _before_answer(bench: Bench) -> None:
    bench.compute()
    bench.save()
    bench.perform(answer=False)


def _after_answer(bench: Bench) -> None:
    bench.compute()
    bench.save()
    bench.perform()


DEATHS = [_before_write, _before_sending, _before_answer, _after_answer]


def ride(bench: Bench, dies: Callable[[int], Callable[[Bench], None] | None]) -> int:
    """A master that sends each update until a state shows it, and a robot that serves waypoints. Returns the ticks."""
    due = [first_part(), second_part()]
    for tick in range(200):
        if due and tick % 3 == 0:
            bench.kernel.receive(*_message(due[0]))
        death = dies(tick)
        if death is None:
            bench.tick()
        else:
            death(bench)
            bench.restart()
            bench.kernel.connected()
        if due and (bench.state.get("orderId"), bench.state.get("orderUpdateId")) == (
            due[0]["orderId"],
            due[0]["orderUpdateId"],
        ):
            due.pop(0)
        if tick % 4 == 3:
            bench.manager.serve()
        order_record = bench.kernel.record.order
        if not due and order_record is not None and order_record.phase is Phase.COMPLETED:
            bench.kernel.connected()
            for _ in range(3):
                bench.tick()
            return tick
    raise AssertionError(f"the order did not end: {bench.kernel.record}")


def _message(data: Data) -> tuple[Topic, bytes]:
    return Topic.ORDER, json.dumps(data).encode()


def check(bench: Bench) -> None:
    assert len(bench.manager.added) == 1
    assert [stop.node for stop in bench.manager.orders[bench.manager.added[0]]] == [2, 2, 4, 6, 6]
    assert (node_ids(bench.state), bench.state["lastNodeId"]) == ([], "d")
    assert statuses(bench.state) == {"w1": "FINISHED", "w2": "FINISHED"}
    assert [error for error in bench.state["errors"] if error["errorType"] == "orderAborted"] == []


@pytest.mark.parametrize("death", DEATHS)
def test_killed_once_at_any_tick(death: Callable[[Bench], None]) -> None:
    alive = Bench()
    ticks = ride(alive, lambda tick: None)
    check(alive)
    for killed_at in range(ticks + 1):
        bench = Bench()
        ride(bench, lambda tick, at=killed_at: death if tick == at else None)  # type: ignore[misc]
        check(bench)


@pytest.mark.parametrize("death", DEATHS[1:])
def test_killed_again_and_again(death: Callable[[Bench], None]) -> None:
    bench = Bench()
    ride(bench, lambda tick: death if tick % 3 else None)
    check(bench)


@pytest.mark.parametrize("death", DEATHS)
def test_killed_at_any_tick_of_a_cancellation(death: Callable[[Bench], None]) -> None:
    for killed_at in range(5):
        bench = Bench()
        bench.order(first_part())
        bench.serve()
        bench.kernel.receive(*_cancel())
        for tick in range(12):
            if tick == killed_at:
                death(bench)
                bench.restart()
                bench.kernel.receive(*_cancel())  # the master has seen no state with it
            else:
                bench.tick()
        bench.kernel.connected()
        bench.tick()
        assert statuses(bench.state)["cancel"] == "FINISHED"
        assert (bench.manager.current, list(bench.manager.ended.values())) == ("", [3])


def _cancel() -> tuple[Topic, bytes]:
    return Topic.INSTANT_ACTIONS, json.dumps(HEADER | {"actions": [action("cancelOrder", "cancel")]}).encode()


# --- the file --------------------------------------------------------------------------------------------------------


def test_the_record_is_read_as_it_was_written(tmp_path: Path) -> None:
    bench = Bench()
    bench.order(first_part())
    bench.serve()
    record = bench.kernel.record
    assert JournalFile(str(tmp_path / "state/journal.json")).save(record) == ""
    assert JournalFile(str(tmp_path / "state/journal.json")).load() == (record, "")


def test_a_journal_that_is_not_there_is_an_empty_one(tmp_path: Path) -> None:
    assert JournalFile(str(tmp_path / "journal.json")).load() == (Record(), "")


@pytest.mark.parametrize("content", [b"", b"{", b'{"order": 1}', b'{"reserved": {"state": -1}}', b"\xff"])
def test_a_damaged_journal_is_kept_aside(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "journal.json"
    path.write_bytes(content)
    record, problem = JournalFile(str(path)).load()
    assert record == Record()
    assert "damaged" in problem
    assert (tmp_path / "journal.json.damaged").read_bytes() == content


def test_a_record_that_cannot_be_written_is_reported_and_written_later(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("in the way", encoding="utf-8")
    journal = JournalFile(str(tmp_path / "state/journal.json"))
    assert "journal.json" in journal.save(Record(last_node="a"))
    (tmp_path / "state").unlink()
    assert journal.save(Record(last_node="a")) == ""
    assert journal.load()[0].last_node == "a"
