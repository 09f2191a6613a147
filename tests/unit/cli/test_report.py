"""``robot-stack report``: the rides of a day and of a recording."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.errors import CommandError
from robot_stack.cli.html_page import seconds
from robot_stack.cli.report import _day
from robot_stack.cli.report_page import report_page
from robot_stack.cli.report_pictures import battery_picture
from robot_stack.core.kept_events import EventRecord, EventState, Software, Trigger
from robot_stack.core.rides import (
    RideCharge,
    RideComfort,
    RideDocking,
    RidePoint,
    RideRecord,
    RideStop,
    RideWaypoint,
    rides_dir,
    write_ride,
)
from tests.unit.sim.test_result_page import Reader

_NOON_S = datetime(2026, 5, 1, 12, 0, 0).astimezone().timestamp()
_RIDE = RideRecord(
    id="20260501-120000",
    mission_id="tour",
    mission_name="Tour <1>",
    began_s=_NOON_S,
    duration_s=75.0,
    state="COMPLETED",
    reason="",
    distance_m=40.0,
    carried_m=12.0,
    top_speed_mps=1.2,
    battery=(0.8, 0.7),
    stops=(RideStop(begin_s=10.0, duration_s=5.0, x=1.0, y=2.0, why="stopped: OBSTACLE_STOP"),
           RideStop(begin_s=20.0, duration_s=4.0, x=None, y=None, why="docking: SEARCH")),
    waypoints=(RideWaypoint(name="gate & yard", done_s=30.0),),
    dockings=(RideDocking(at_s=25.0, error_m=0.0007, error_deg=0.05),),
    path=tuple(RidePoint(at_s=float(i), x=0.5 * i, y=0.0, speed_mps=0.5) for i in range(10)),
    comfort=RideComfort(weighted_mps2=(0.1, 0.1, 0.2), total_mps2=0.245, jerk_p99_mps3=0.8, duration_s=40.0),
    charges=(RideCharge(at_s=0.0, charge=0.8), RideCharge(at_s=50.0, charge=0.72)),
)  # fmt: skip
_EVENT = EventRecord(
    id="20260501-120100",
    state=EventState.COMPLETE,
    triggers=(Trigger(at_s=_NOON_S + 60.0, ros_s=0.0, reasons=("TILT",)),),
    software=Software(version="1", sha256=""),
    map=None,
    nodes=(),
)


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["report", *arguments])


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_page_shows_rides_stops_and_events() -> None:
    other = _RIDE.model_copy(update={"id": "later", "began_s": _NOON_S + 600.0, "state": "FAILED", "reason": "no way"})
    read = Reader(report_page("Friday", [_RIDE, other], [_EVENT], {"20260501-120000": b"png", "later": b"png"}))
    for text in ("1 of 2", "Tour <1>", "stopped: OBSTACLE_STOP", "x 1.0 m, y 2.0 m", "gate & yard", "no way", "TILT"):
        assert text in read.text, text
    assert "1 mm, 0.1°" in read.text
    assert len(read.pictures) == 2
    # In the day's list, and with its ride only.
    assert read.text.count("TILT") == 2


def test_comfort_battery_and_pictures_of_events_are_shown() -> None:
    pictures = {_RIDE.id: b"ride"}
    read = Reader(report_page("Friday", [_RIDE], [_EVENT], pictures, {_EVENT.id: b"event"}, b"battery"))
    for text in ("0.24 m/s²", "ISO 2631-1", "0.8 m/s³", "99th percentile"):
        assert text in read.text, text
    assert len(read.pictures) == 3
    older = _RIDE.model_copy(update={"comfort": None})
    assert "ISO 2631-1" not in Reader(report_page("Friday", [older], [], pictures)).text


def test_the_battery_is_drawn_over_the_day() -> None:
    evening = _RIDE.model_copy(update={"began_s": _NOON_S + 6.0 * 3600.0})
    noon, day = battery_picture([_RIDE], []), battery_picture([_RIDE, evening], [_EVENT])
    assert noon is not None
    assert day is not None
    assert noon != day
    assert battery_picture([_RIDE.model_copy(update={"charges": (), "battery": (None, None)})], []) is None


def test_a_record_of_earlier_software_is_read(state: Path) -> None:
    data = _RIDE.model_dump(mode="json", exclude={"comfort", "charges"})
    rides_dir().mkdir(parents=True)
    (rides_dir() / "old.json").write_text(json.dumps(data))
    (ride,) = json.loads(call("2026-05-01", "--json").stdout)
    assert (ride["comfort"], ride["charges"]) == (None, [])


def test_the_report_of_a_day(state: Path) -> None:
    write_ride(rides_dir(), _RIDE)
    write_ride(rides_dir(), _RIDE.model_copy(update={"id": "next", "began_s": _NOON_S + 86_400.0}))
    (rides_dir() / "torn.json").write_text("{")
    shown = call("2026-05-01", "--map", "")
    assert shown.exit_code == 0, shown.output
    assert "report-2026-05-01.html" in shown.output
    assert "torn.json is no record" in shown.output
    page = (state / "report-2026-05-01.html").read_text()
    assert "Friday, 2026-05-01" in page
    assert page.count("<h2") == 1
    (ride,) = json.loads(call("2026-05-01", "--json").stdout)
    assert ride["distance_m"] == 40.0


def test_the_route_is_drawn_on_the_map(state: Path) -> None:
    write_ride(rides_dir(), _RIDE)
    without, beside = (state / "without.html", state / "with.html")
    assert call("2026-05-01", "--map", "", "-o", str(without)).exit_code == 0
    assert call("2026-05-01", "--map", "yard", "-o", str(beside)).exit_code == 0
    assert without.read_text() != beside.read_text()


@pytest.mark.parametrize("day", ["today", "yesterday", "2020-01-01"])
def test_a_day_without_rides(state: Path, day: str) -> None:
    midnight = datetime.now().astimezone().date()
    named = {"today": midnight, "yesterday": midnight - timedelta(days=1)}.get(day, day)
    shown = call(day)
    assert isinstance(shown.exception, CommandError)
    assert (str(shown.exception), shown.exception.code) == (f"no rides on {named}", 1)
    neither = call("last week").exception
    assert isinstance(neither, CommandError)
    assert neither.code == 2


def test_a_recording_of_a_ride(state: Path) -> None:
    """The recording ends on the way to the first waypoint; it is thinned and has no pose."""
    folder = Path(__file__).resolve().parents[2] / "rides"
    shown = call(str(folder / "first_leg.mcap"), "--map", "")
    assert shown.exit_code == 0, shown.output
    page = (state / "report-first_leg.html").read_text()
    assert "about to start: warning persons around the robot" in page
    assert "<td>RUNNING, end not recorded</td>" in page
    (ride,) = json.loads(call(str(folder / "first_leg.mcap"), "--json").stdout)
    assert (ride["mission_id"], ride["state"]) == ("short_transport", "RUNNING")
    assert ride["distance_m"] == pytest.approx(2.8, abs=0.1)
    error = call(str(folder / "goal_ahead.mcap")).exception
    assert isinstance(error, CommandError)
    assert "contains no mission" in str(error)


def test_files_of_several_recordings_are_not_one_ride(state: Path) -> None:
    """Files with one prefix may be parts of one recording; the times of these two show that they are not."""
    ride = Path(__file__).resolve().parents[2] / "rides" / "first_leg.mcap"
    parts = state / "parts"
    parts.mkdir()
    for name in ("ride_1.mcap", "ride_2.mcap"):
        (parts / name).symlink_to(ride)
    rides = json.loads(call(str(parts), "--json").stdout)
    assert [item["distance_m"] for item in rides] == [pytest.approx(2.8, abs=0.1)] * 2
    assert len({item["id"] for item in rides}) == 2
    (parts / "other.mcap").symlink_to(ride)
    error = call(str(parts)).exception
    assert isinstance(error, CommandError)
    assert error.code == 2
    assert "contains 2 recordings, which begin with" in str(error)
    (parts / "ride_1.mcap").unlink()
    (parts / "other.mcap").unlink()
    assert len(json.loads(call(str(parts), "--json").stdout)) == 1


@pytest.mark.parametrize(
    ("time_s", "shown"),
    [(59.9, "59.9 s"), (59.97, "1 min 0 s"), (119.7, "2 min 0 s"), (3725.0, "62 min 5 s")],
)
def test_times_of_a_page(time_s: float, shown: str) -> None:
    assert seconds(time_s) == shown


@pytest.mark.parametrize("day", ["0001-01-01", "9999-12-31"])
def test_a_day_beyond_all_clocks_is_none(day: str) -> None:
    assert _day(day) is None
