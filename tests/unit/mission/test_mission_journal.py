"""The journal on real disks: power cuts, full disks and damaged files."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.core.geometry import Pose2
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission.journal import SqliteJournal, _order_to_data, _queue_to_data, journal_path, read_history
from robot_stack.mission.orders import Order, OrderQueue, OrderState, Origin
from robot_stack.mission.perform import JournalDamaged, JournalError, load_record
from robot_stack.mission.record import Record
from robot_stack.mission.states import AT_DOCK, State

from .conftest import make_mission

RIDE = make_mission("pass", {"wait": 2.5}, {"dock": "椅子_1"}, "undock", "park")
QUEUE = OrderQueue(
    orders=(
        Order("注文 1", "ride", Origin.FLEET, 200, 1.7e9, mission=RIDE),
        Order("b", "ride", Origin.CLI, mission=RIDE, route="0a", open=True),
    ),
    current=Order("a", "ride", Origin.TOUCH_SCREEN, state=OrderState.UNDER_WAY, route="1b", open=True),
    ended=(Order("z", "hop", Origin.UI_COMMAND, 0, state=OrderState.REMOVED),),
    number=7,
)
PLACE = SafePlace(name="base", x=1.0, y=2.0, yaw=0.5)
FULL = Record(
    State.WAITING,
    RIDE,
    1,
    2,
    True,
    True,
    Pose2(1.0, -2.0, 0.5),
    "because; 理由",
    queue=QUEUE,
    safe_place=PLACE,
    leaving=True,
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "state" / "mission.db"


def reopened(path) -> Record:
    with closing(SqliteJournal(path)) as journal:
        return journal.load()


def save(path, record: Record) -> None:
    with closing(SqliteJournal(path)) as journal:
        journal.save(record)


@settings(max_examples=30, deadline=None)
@given(
    st.builds(
        Record,
        st.sampled_from(sorted(set(State) - AT_DOCK, key=lambda state: state.value)),
        st.just(RIDE),
        st.integers(0, 4),
        st.integers(0, 3),
        st.booleans(),
        st.booleans(),
        st.none() | st.builds(Pose2, *[st.floats(-1e4, 1e4)] * 3),
        st.text(st.characters(exclude_categories=["Cs"])),
        st.booleans(),
    )
    | st.builds(Record, st.just(State.DOCKING), st.just(RIDE), st.just(2), docking_begun=st.just(True))
    | st.builds(Record, st.just(State.UNDOCKING), st.just(RIDE), st.just(3), docking_begun=st.just(True))
)
def test_every_record_comes_back_as_it_was(tmp_path_factory, record):
    path = tmp_path_factory.mktemp("journal") / "mission.db"
    save(path, record)
    assert reopened(path) == record


def test_a_journal_from_before_the_queue_is_read(path):
    save(path, FULL)
    with closing(sqlite3.connect(path)) as connection, connection:
        data = json.loads(connection.execute("SELECT record FROM current").fetchone()[0])
        del data["queue"], data["safe_place"], data["leaving"]
        connection.execute("UPDATE current SET record = ?", (json.dumps(data),))
    assert reopened(path) == replace(FULL, queue=OrderQueue(), safe_place=None, leaving=False)


def test_a_journal_from_before_own_routes_is_read(path):
    save(path, FULL)
    with closing(sqlite3.connect(path)) as connection, connection:
        data = json.loads(connection.execute("SELECT record FROM current").fetchone()[0])
        for order in (*data["queue"]["orders"], data["queue"]["current"]):
            del order["route"], order["open"]
        connection.execute("UPDATE current SET record = ?", (json.dumps(data),))
    queue = reopened(path).queue
    assert [(order.route, order.open) for order in (*queue.orders, queue.current)] == 3 * [("", False)]


def test_it_is_written_through_to_the_disk(path):
    journal = SqliteJournal(path)
    journal.save(FULL)
    connection = journal._open()
    assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert connection.execute("PRAGMA synchronous").fetchone() == (2,)  # FULL


def test_history_returns_latest_records_in_order(path):
    journal = SqliteJournal(path)
    for state in (State.RUNNING, State.PAUSED, State.ABORTED):
        journal.save(replace(FULL, state=state, reason=f"why {state.value}", safe_place=None))
    rows = read_history(path, 2)
    assert [row[1:] for row in rows] == [
        ("PAUSED", "ride", "w1", True, "why PAUSED"),
        ("ABORTED", "ride", "w1", True, "why ABORTED"),
    ]


def test_the_history_does_not_grow_for_ever(path, monkeypatch):
    prune = "DELETE FROM history WHERE number <= (SELECT max(number) FROM history) - 5"
    monkeypatch.setattr("robot_stack.mission.journal._PRUNE", prune)
    journal = SqliteJournal(path)
    for _ in range(20):
        journal.save(FULL)
    assert len(read_history(path, 100)) == 5


# --- the path --------------------------------------------------------------------------------------------------------


def test_the_default_path_is_by_domain(monkeypatch, tmp_path):
    monkeypatch.setenv("ROS_DOMAIN_ID", "17")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert journal_path() == tmp_path / "robot_stack" / "domain-17" / "mission.db"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert str(journal_path("~/here.db")) == "/home/somebody/here.db"
    assert str(journal_path()) == "/home/somebody/.local/state/robot_stack/domain-17/mission.db"


# --- damage ----------------------------------------------------------------------------------------------------------


def overwrite_header(path):
    path.write_bytes(b"this is not a database at all" + bytes(5000))


def overwrite_a_page(path):
    data = bytearray(path.read_bytes())
    data[4096 : 4096 + 2000] = os.urandom(2000)
    path.write_bytes(data)


def truncate(path):
    path.write_bytes(path.read_bytes()[:5000])


def in_bytes(old, new):
    def damage(path):
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new))

    return damage


def in_sql(statement, *values):
    def damage(path):
        with sqlite3.connect(path) as connection:
            connection.execute(statement, values)
        connection.close()

    return damage


def with_record(**changes):
    def damage(path):
        with sqlite3.connect(path) as connection:
            data = json.loads(connection.execute("SELECT record FROM current").fetchone()[0])
            connection.execute("UPDATE current SET record = ?", (json.dumps({**data, **changes}),))
        connection.close()

    return damage


DAMAGES = {
    "header": overwrite_header,
    "page": overwrite_a_page,
    "truncated": truncate,
    "version": in_sql("PRAGMA user_version = 99"),
    "a column's name": in_bytes(b"record TEXT", b"recorf TEXT"),
    "schema no text": in_bytes(b"CREATE TABLE current", b"CREATE TABL\xc5 current"),
    "record no text": in_sql("UPDATE current SET record = CAST(X'7bff7d' AS TEXT)"),
    "no json": in_sql("UPDATE current SET record = '{'"),
    "a list": in_sql("UPDATE current SET record = '[]'"),
    "a key missing": in_sql("UPDATE current SET record = '{}'"),
    "unknown state": with_record(state="FLYING"),
    "mission invalid": with_record(mission={"id": "ride"}),
    "no mission": with_record(mission=None),
    "waypoint beyond the end": with_record(waypoint=99),
    "waypoint negative": with_record(waypoint=-1),
    "start not finite": with_record(start=[float("nan"), 0.0, 0.0]),
    "start too short": with_record(start=[0.0]),
    "queue without its parts": with_record(queue={"orders": []}),
    "order without its mission": with_record(
        queue={**_queue_to_data(QUEUE), "orders": [_order_to_data(QUEUE.ended[0])]}
    ),
    "two orders with one id": with_record(queue={**_queue_to_data(QUEUE), "ended": [_order_to_data(QUEUE.current)]}),
    "open without an own route": with_record(
        queue={**_queue_to_data(QUEUE), "current": {**_order_to_data(QUEUE.current), "route": ""}}
    ),
    "safe place without a pose": with_record(safe_place={"name": "base"}),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_damaged_journal_is_moved_aside_and_reported(path, name):
    save(path, FULL)
    DAMAGES[name](path)
    damaged = path.read_bytes()

    record, problem = load_record(SqliteJournal(path))

    assert record == Record()
    aside = [item for item in path.parent.glob("*.damaged-*") if not item.name.endswith(("-wal", "-shm"))]
    assert [item.read_bytes() for item in aside] == [damaged], "kept as it was, for whoever wants to look"
    assert str(path) in problem
    assert aside[0].name in problem
    assert "\n" not in problem
    save(path, FULL)
    assert reopened(path) == FULL, "and a new journal takes its place"


@pytest.mark.parametrize(
    "damage",
    [DAMAGES["version"], DAMAGES["schema no text"], in_sql("ALTER TABLE history RENAME TO other")],
    ids=["version", "schema", "history"],
)
def test_a_journal_damaged_while_in_use_fails_one_save_and_is_moved_aside(path, damage):
    save(path, FULL)
    damage(path)
    journal = SqliteJournal(path)
    with pytest.raises(JournalError, match=r"mission\.db was damaged .* and is now mission\.db\.damaged-"):
        journal.save(FULL)
    journal.save(FULL)
    assert reopened(path) == FULL


def test_a_damaged_journal_that_cannot_be_moved_is_an_error(path, monkeypatch):
    save(path, FULL)
    overwrite_header(path)

    def refuse(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(JournalError, match="cannot be moved aside"):
        SqliteJournal(path).load()


def test_a_locked_journal_is_not_a_damaged_one(path):
    save(path, FULL)
    other = sqlite3.connect(path)
    other.execute("PRAGMA locking_mode = EXCLUSIVE")
    other.execute("BEGIN EXCLUSIVE")
    try:
        journal = SqliteJournal(path)
        with pytest.raises(JournalError, match="locked"):
            journal.load()
        with pytest.raises(JournalError, match="locked"):
            journal.save(FULL)
    finally:
        other.rollback()
        other.close()
    with pytest.raises(JournalError, match="not overwritten"):
        journal.save(Record())
    assert journal.load() == FULL, "the same journal works once the lock is gone"
    journal.save(Record())
    assert journal.load() == Record()
    assert [item.name for item in path.parent.iterdir() if "damaged" in item.name] == []


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "state").write_text("a file where a folder should be")
    journal = SqliteJournal(tmp_path / "state" / "mission.db")
    with pytest.raises(JournalError, match=r"mission\.db: (Not a directory|File exists)"):
        journal.save(FULL)
    with pytest.raises(JournalError):
        journal.load()


# --- a full disk, for real: the operating system refuses to let the files grow ---------------------------------------

_FILL = """
import resource, sys
from dataclasses import replace
from pathlib import Path
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.perform import JournalError
from robot_stack.mission.states import State
sys.path.insert(0, sys.argv[2])
from tests.unit.mission.test_mission_journal import FULL
journal = SqliteJournal(Path(sys.argv[1]))
journal.save(FULL)
size = sum(part.stat().st_size for part in Path(sys.argv[1]).parent.iterdir())
resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
try:
    for number in range(10_000):
        journal.save(replace(FULL, failed_tries=number, reason="x" * 2000))
    print("never full")
except JournalError as error:
    print("full:", error)
    last = number - 1
    assert journal.load().failed_tries == last, (journal.load().failed_tries, last)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    journal.save(replace(FULL, state=State.PAUSED))
    assert journal.load().state is State.PAUSED
    print("recovered")
"""


def run_python(code: str, *arguments: object, **options) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=os.getcwd(), **options)


def test_a_full_disk_is_an_error_and_the_record_before_stays(path):
    done = run_python(_FILL, path, os.getcwd())
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("full: ")
    assert str(path) in done.stdout
    assert done.stdout.endswith("recovered\n")


# --- power cuts ------------------------------------------------------------------------------------------------------

_WRITE_FOR_EVER = """
import itertools, sys
from dataclasses import replace
from pathlib import Path
from robot_stack.mission.journal import SqliteJournal
from robot_stack.mission.orders import Order, OrderQueue, Origin
from robot_stack.mission.record import Record
from robot_stack.mission.states import State
from tests.unit.mission.test_mission_journal import RIDE
journal = SqliteJournal(Path(sys.argv[1]))
for number in itertools.count():
    queue = OrderQueue((Order(f"order {number}", "ride", Origin.FLEET, mission=RIDE),), number=number)
    record = Record(State.RUNNING, RIDE, number % 5, number, False, True, None, f"{number} " * 200, queue=queue)
    journal.save(record)
    print(number, flush=True)
"""


def test_a_process_killed_while_it_writes_loses_nothing_it_has_saved(path):
    for saves in (1, 40, 90):
        process = subprocess.Popen(
            [sys.executable, "-c", _WRITE_FOR_EVER, str(path)], stdout=subprocess.PIPE, text=True, cwd=os.getcwd()
        )
        assert process.stdout is not None
        try:
            for _ in range(saves):
                line = process.stdout.readline()
        finally:
            process.send_signal(signal.SIGKILL)
            rest = process.stdout.read()  # communicate would skip the data buffered by readline
            process.wait(timeout=30)
        reported = [int(text) for text in (line + rest).split("\n") if text]
        record = reopened(path)
        # The interrupted save may have completed before its number was printed.
        assert record.failed_tries in (reported[-1], reported[-1] + 1)
        assert record.reason == f"{record.failed_tries} " * 200
        assert record.waypoint == record.failed_tries % 5
        assert [order.id for order in record.queue.orders] == [f"order {record.failed_tries}"]
        assert record.passenger_attached
        assert record.mission == RIDE


def test_load_record_reports_unreadable_and_damaged_journal(path):
    class Broken:
        def load(self):
            raise JournalError("no disk")

        def save(self, record):
            raise JournalError("no disk")

    class Damaged(Broken):
        def load(self):
            raise JournalDamaged("it was damaged")

    assert load_record(Broken()) == (Record(), "the journal cannot be read: no disk")
    assert load_record(Damaged()) == (Record(), "it was damaged; a mission may have been under way")
