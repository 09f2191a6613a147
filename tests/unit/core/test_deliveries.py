"""The messages owed to a subscriber: pure accounting, without middleware and without time."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_stack.contract import topics
from robot_stack.core.deliveries import (
    NUMBERS,
    PUBLISHES,
    TAKES,
    WAKES,
    Debt,
    Deliveries,
    Delivery,
    debts,
    number_of,
    open_debts,
    open_delivery,
    publishers_by_row,
    rows_taken,
    topic_name,
    write_off,
)

ROW = NUMBERS[topics.JOINT_STATES]
OTHER = NUMBERS[topics.ODOM]


def subscriber(taken_ns: int = 0, row: int = ROW, use: int = TAKES) -> Delivery:
    page = Delivery()
    page.uses[row], page.taken[row] = use, taken_ns
    return page


def publisher(sent_ns: int = 0, row: int = ROW) -> Delivery:
    page = Delivery()
    page.uses[row], page.published[row] = PUBLISHES, sent_ns
    return page


def owed(own: Delivery, *publishers: Delivery) -> list[Debt]:
    return debts(own, rows_taken(own), publishers_by_row([own, *publishers]))


@pytest.mark.parametrize(
    ("taken_ns", "sent_ns", "due_ns"),
    [
        (105, [100], None),  # the middleware's stamp lies between the publisher's record and the end of its call
        (95, [100], 100),
        (0, [100], None),  # nothing taken yet
        (105, [100, 90, 0], None),
        (105, [100, 120], 120),  # of several publishers the latest counts
        (105, [0], None),  # a publisher that has restarted
        (105, [200], 200),
    ],
)
def test_the_newest_message_that_was_not_taken_is_owed(taken_ns: int, sent_ns: list[int], due_ns: int | None) -> None:
    publishers = [publisher(sent) for sent in sent_ns]
    own = subscriber(taken_ns)
    assert owed(own, *publishers) == ([] if due_ns is None else [Debt(ROW, due_ns)])
    if due_ns is not None:
        own.taken[ROW] = due_ns + 1
        assert owed(own, *publishers) == [], "it settles those that it overwrote"


def test_rows_do_not_mix_and_only_publishers_publish() -> None:
    assert owed(subscriber(taken_ns=95), publisher(sent_ns=100, row=OTHER)) == []
    assert publishers_by_row([subscriber(), publisher()]).keys() == {ROW}


def test_message_published_during_wait_is_not_awaited() -> None:
    own, other = subscriber(taken_ns=95), publisher(sent_ns=100)
    known = owed(own, other)
    other.published[ROW] = 200
    own.taken[ROW] = 101
    assert open_debts(own, known) == []
    assert owed(own, other) == [Debt(ROW, 200)]


def test_a_lost_message_is_waited_for_no_longer_and_the_next_one_is() -> None:
    own, other = subscriber(taken_ns=95), publisher(sent_ns=100)
    write_off(own, owed(own, other))
    assert owed(own, other) == []
    assert own.lost[0] == 1
    other.published[ROW] = 200
    assert owed(own, other) == [Debt(ROW, 200)]


def test_taken_rows_can_be_filtered_by_wake_flag() -> None:
    own = subscriber(use=TAKES | WAKES)
    own.uses[OTHER] = TAKES
    assert set(rows_taken(own)) == {ROW, OTHER}
    assert rows_taken(own, WAKES) == (ROW,)
    assert topic_name(ROW) == "/joint_states"


def test_a_row_of_a_test_has_no_number() -> None:
    row = topics.JOINT_STATES
    assert number_of(row) == ROW
    assert number_of(type(row)("/mine", row.type, row.qos, (), (), "")) is None


class TestPages:
    @pytest.fixture(autouse=True)
    def _folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(tmp_path))

    def test_reader_sees_written_values_and_later_nodes(self) -> None:
        reader = Deliveries()
        reader.search()
        assert reader.pages == {}
        first = open_delivery("first", create=True)
        reader.search()
        second = open_delivery("second", create=True)
        reader.search()
        first.published[ROW], second.taken[ROW] = 7, 8
        assert reader.pages["first"].published[ROW] == 7
        assert reader.pages["second"].taken[ROW] == 8

    def test_restarted_node_clears_page_and_readers_keep_it(self) -> None:
        reader = Deliveries()
        open_delivery("node", create=True).taken[ROW] = 8
        reader.search()
        again = open_delivery("node", create=True)
        assert reader.pages["node"].taken[ROW] == 0
        again.taken[ROW] = 9
        assert reader.pages["node"].taken[ROW] == 9

    def test_a_page_that_is_not_there_cannot_be_read(self) -> None:
        open_delivery("node", create=True)
        with pytest.raises(FileNotFoundError):
            open_delivery("nobody", create=False)
