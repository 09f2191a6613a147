"""The journal in SQLite: one current record, and the history of records for diagnosis.

Write-ahead log with ``synchronous=FULL``: when ``save`` returns, the record has been flushed to the disk; a process
killed or a machine switched off at any moment leaves the record before or the record after, never half of one.
https://www.sqlite.org/pragma.html#pragma_synchronous
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Mission
from robot_stack.core.runtime import state_dir
from robot_stack.core.safe_places import SafePlace
from robot_stack.mission.orders import Order, OrderQueue, OrderState, Origin
from robot_stack.mission.perform import JournalDamaged, JournalError
from robot_stack.mission.record import Record, problem_of
from robot_stack.mission.states import State

_VERSION = 1
# Timeout of a save for the lock of another process (a person with an SQLite shell): the node's loop waits with it.
_LOCK_TIMEOUT_S = 0.2
# About a year of rides, 10 MB.
_HISTORY_ROWS = 50_000

_SCHEMA = f"""
CREATE TABLE current (only INTEGER PRIMARY KEY CHECK (only = 1), saved_at REAL NOT NULL, record TEXT NOT NULL);
CREATE TABLE history (number INTEGER PRIMARY KEY AUTOINCREMENT, saved_at REAL NOT NULL, state TEXT NOT NULL,
                      mission TEXT NOT NULL, waypoint TEXT NOT NULL, passenger INTEGER NOT NULL, reason TEXT NOT NULL);
PRAGMA user_version = {_VERSION};
"""
_SAVE = "INSERT OR REPLACE INTO current VALUES (1, ?, ?)"
_LOG = "INSERT INTO history (saved_at, state, mission, waypoint, passenger, reason) VALUES (?, ?, ?, ?, ?, ?)"
_PRUNE = f"DELETE FROM history WHERE number <= (SELECT max(number) FROM history) - {_HISTORY_ROWS}"


def journal_path(named: str = "") -> Path:
    """named: empty for ``mission.db`` in the state folder of this domain."""
    return Path(named).expanduser() if named else state_dir() / "mission.db"


class SqliteJournal:
    """The journal at ``path``. Opened when needed and again after an error, so that a disk that recovers is used."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection: sqlite3.Connection | None = None
        self._unread = False  # it may hold a record that is not known

    def load(self) -> Record:
        """See Journal.load."""
        try:
            row = self._open().execute("SELECT CAST(record AS BLOB) FROM current").fetchone()
            self._unread = False
            return Record() if row is None else _from_json(row[0])
        except _ERRORS as error:
            if not _is_damage(error):
                self.close()
                self._unread = True
                raise JournalError(self._text(error)) from error
            raise self._move_aside(error) from error

    def save(self, record: Record) -> None:
        """See Journal.save."""
        try:
            connection = self._open()
            if self._unread and connection.execute("SELECT only FROM current").fetchone() is not None:
                raise JournalError(f"{self.path} could not be read and is not overwritten; restart the mission manager")
            self._unread = False
            with connection:  # one transaction
                connection.execute("BEGIN IMMEDIATE")
                now_s = time.time()
                connection.execute(_SAVE, (now_s, _to_json(record)))
                connection.execute(_LOG, (now_s, *_history_columns(record)))
                connection.execute(_PRUNE)
        except _ERRORS as error:
            self.close()
            raise JournalError(str(self._move_aside(error)) if _is_damage(error) else self._text(error)) from error

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _open(self) -> sqlite3.Connection:
        if self._connection is None:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            connection = sqlite3.connect(self.path, timeout=_LOCK_TIMEOUT_S, isolation_level=None)
            try:
                _prepare(connection)
            except BaseException:
                connection.close()
                raise
            self._connection = connection
        return self._connection

    def _move_aside(self, error: Exception) -> JournalDamaged | JournalError:
        """Keeps the damaged files for inspection, and makes room for a new journal."""
        self.close()
        suffix = time.strftime(".damaged-%Y%m%d-%H%M%S", time.gmtime())
        target = self.path.with_name(self.path.name + suffix)
        try:
            for part in ("-wal", "-shm", ""):  # the log first: a database without its log is less than one with it
                source = Path(f"{self.path}{part}")
                if source.exists():
                    os.replace(source, f"{target}{part}")
        except OSError as move_error:
            return JournalError(f"{self.path} is damaged ({_one_line(error)}) and cannot be moved aside: {move_error}")
        return JournalDamaged(f"the journal {self.path} was damaged ({_one_line(error)}) and is now {target.name}")

    def _text(self, error: Exception) -> str:
        return f"{self.path}: {error.strerror if isinstance(error, OSError) and error.strerror else _one_line(error)}"


class _Nonsense(Exception):
    """The database is readable, but its content is not a valid journal."""


# UnicodeDecodeError: of SQLite's message about a damaged schema.
_ERRORS = (sqlite3.Error, OSError, UnicodeDecodeError, _Nonsense)
_NOT_NOW = (
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_CANTOPEN,
)


def _is_damage(error: Exception) -> bool:
    """False if the same journal may work later. An extended code has its primary one in the lowest byte."""
    if isinstance(error, sqlite3.Error):
        return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF not in _NOT_NOW
    return not isinstance(error, OSError)


def _prepare(connection: sqlite3.Connection) -> None:
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if version == 0 and not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
        return
    if version != _VERSION:
        raise _Nonsense(f"its version is {version}, not {_VERSION}")
    check = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
    if check != "ok":
        raise _Nonsense(str(check))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _to_json(record: Record) -> str:
    start = record.start
    return json.dumps(
        {
            "state": record.state.value,
            "mission": record.mission.model_dump(mode="json") if record.mission else None,
            "waypoint": record.waypoint,
            "failed_tries": record.failed_tries,
            "homeward": record.homeward,
            "passenger_attached": record.passenger_attached,
            "start": [start.x, start.y, start.yaw] if start else None,
            "reason": record.reason,
            "docking_begun": record.docking_begun,
            "queue": _queue_to_data(record.queue),
            "safe_place": record.safe_place.model_dump(mode="json") if record.safe_place else None,
            "leaving": record.leaving,
        },
        ensure_ascii=False,
    )


def _from_json(text: bytes) -> Record:
    try:
        data: dict[str, Any] = json.loads(str(text, "utf-8"))
        start = data["start"]
        record = Record(
            state=State(data["state"]),
            mission=Mission.model_validate(data["mission"]) if data["mission"] else None,
            waypoint=int(data["waypoint"]),
            failed_tries=int(data["failed_tries"]),
            homeward=bool(data["homeward"]),
            passenger_attached=bool(data["passenger_attached"]),
            start=Pose2(*map(float, start)) if start else None,
            reason=str(data["reason"]),
            docking_begun=bool(data.get("docking_begun", False)),  # journals from before docking have none
            queue=_queue_from_data(data["queue"]) if "queue" in data else OrderQueue(),  # nor a queue
            safe_place=SafePlace.model_validate(data["safe_place"]) if data.get("safe_place") else None,
            leaving=bool(data.get("leaving", False)),
        )
    except ValidationError as error:
        raise _Nonsense(f"its mission is invalid in {error.error_count()} places") from error
    except (ValueError, KeyError, TypeError) as error:
        raise _Nonsense(f"its record cannot be read: {error!r}") from error
    problem = problem_of(record)
    if problem:
        raise _Nonsense(f"its record is inconsistent: {problem}")
    return record


def _queue_to_data(queue: OrderQueue) -> dict[str, Any]:
    return {
        "orders": [_order_to_data(order) for order in queue.orders],
        "current": _order_to_data(queue.current) if queue.current else None,
        "ended": [_order_to_data(order) for order in queue.ended],
        "number": queue.number,
    }


def _queue_from_data(data: dict[str, Any]) -> OrderQueue:
    return OrderQueue(
        orders=tuple(map(_order_from_data, data["orders"])),
        current=_order_from_data(data["current"]) if data["current"] else None,
        ended=tuple(map(_order_from_data, data["ended"])),
        number=int(data["number"]),
    )


def _order_to_data(order: Order) -> dict[str, Any]:
    return {
        "id": order.id,
        "mission_id": order.mission_id,
        "origin": order.origin.value,
        "priority": order.priority,
        "earliest_s": order.earliest_s,
        "state": order.state.value,
        "mission": order.mission.model_dump(mode="json") if order.mission else None,
        "route": order.route,
        "open": order.open,
    }


def _order_from_data(data: dict[str, Any]) -> Order:
    return Order(
        id=str(data["id"]),
        mission_id=str(data["mission_id"]),
        origin=Origin(data["origin"]),
        priority=int(data["priority"]),
        earliest_s=float(data["earliest_s"]),
        state=OrderState(data["state"]),
        mission=Mission.model_validate(data["mission"]) if data["mission"] else None,
        route=str(data.get("route", "")),  # journals from before own routes have none
        open=bool(data.get("open", False)),
    )


def _history_columns(record: Record) -> tuple[str, str, str, bool, str]:
    mission = record.mission.id if record.mission else ""
    waypoint = record.current.name if record.current else ""
    return record.state.value, mission, waypoint, record.passenger_attached, record.reason


def read_history(path: Path, rows: int) -> list[tuple[float, str, str, str, bool, str]]:
    """The newest ``rows`` entries, oldest first: (unix time in s, state, mission, waypoint, passenger, reason)."""
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=_LOCK_TIMEOUT_S)) as connection:
        query = "SELECT saved_at, state, mission, waypoint, passenger, reason FROM history ORDER BY number DESC LIMIT ?"
        return [(*row[:4], bool(row[4]), row[5]) for row in reversed(connection.execute(query, (rows,)).fetchall())]
