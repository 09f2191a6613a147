"""Missions from two folders and missions created by users: written whole, validated first, never overwritten unseen."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from robot_stack.core.mission import Mission
from robot_stack.core.mission_library import MissionError, MissionLibrary, judge, mission_library, read_mission
from robot_stack.core.own_missions import MissionChanged, MissionTaken, OwnMissions, revision_of

DATA = {
    "id": "tour",
    "name": {"en": "Tour", "ja": "一周", "zh": "一圈"},
    "home": {"x": 0.0, "y": 0.0, "yaw": 0.0},
    "waypoints": [
        {"name": "gate", "x": 1.0, "y": 2.0, "yaw": 0.5, "action": "pass"},
        {"name": "chair", "x": 1.5, "y": 2.0, "yaw": 0.5, "action": {"dock": "chair_1"}},
        {"name": "bench", "x": 2.0, "y": 2.0, "yaw": 0.5, "action": {"wait": 2.5}},
    ],
}
DOCKS = {"chair_1": "wheelchair", "charger": "station"}


def mission(mission_id: str = "tour", name: str = "Tour") -> Mission:
    return Mission.model_validate(DATA | {"id": mission_id, "name": {"en": name, "ja": name, "zh": name}})


@pytest.fixture
def shipped(tmp_path: Path) -> Path:
    folder = tmp_path / "shipped"
    OwnMissions(folder, tmp_path / "none").save(mission("yard"))
    return folder


@pytest.fixture
def own(tmp_path: Path, shipped: Path) -> OwnMissions:
    return OwnMissions(tmp_path / "own", shipped)


def test_both_folders_are_one_library(own: OwnMissions, shipped: Path) -> None:
    library = MissionLibrary(shipped, own.folder)
    assert library.ids() == ["yard"]  # the other folder does not exist yet
    own.save(mission())
    assert library.ids() == ["tour", "yard"]
    assert library.find("tour") == mission()
    with pytest.raises(MissionError, match="there is no mission 'park'; known: tour, yard"):
        library.find("park")


def test_a_name_that_is_there_twice_is_nobodys(own: OwnMissions, shipped: Path) -> None:
    own.save(mission())
    (own.folder / "tour.yaml").rename(own.folder / "yard.yaml")
    with pytest.raises(MissionError, match=r"there are two missions 'yard': .*shipped.* and .*own"):
        MissionLibrary(shipped, own.folder).find("yard")


def test_where_the_library_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert mission_library().folders[1] == tmp_path / "robot_stack" / "missions"
    assert "site_ride" in mission_library().ids()
    assert mission_library(str(tmp_path / "a"), "~/b").folders == (tmp_path / "a", Path.home() / "b")


def test_a_new_mission_takes_nobodys_place(own: OwnMissions) -> None:
    own.save(mission())
    assert read_mission(own.path("tour")) == mission()
    before = own.path("tour").read_bytes()
    for taken in ("tour", "yard"):
        with pytest.raises(MissionTaken):
            own.save(mission(taken, "Other"))
        with pytest.raises(MissionTaken):
            own.require_free(taken)
    own.require_free("tour", was="tour")
    own.require_free("other", was="tour")
    assert own.path("tour").read_bytes() == before
    assert os.listdir(own.folder) == ["tour.yaml"]


def test_a_change_and_a_new_name_need_the_content_that_was_opened(own: OwnMissions) -> None:
    own.save(mission())
    opened = revision_of(own.path("tour"))
    own.save(mission(name="Second"), "tour", opened)
    for stale in (opened, "", "0" * 16):
        with pytest.raises(MissionChanged):
            own.save(mission(name="Third"), "tour", stale)
        with pytest.raises(MissionChanged):
            own.save(mission("other"), "tour", stale)
        with pytest.raises(MissionChanged):
            own.delete("tour", stale)
    with pytest.raises(MissionChanged):
        own.save(mission("other"), "gone", "")
    own.save(mission("taken"))
    with pytest.raises(MissionTaken):
        own.save(mission("taken"), "tour", revision_of(own.path("tour")))
    own.delete("taken", revision_of(own.path("taken")))
    assert read_mission(own.path("tour")).name.en == "Second"
    own.save(mission("other"), "tour", revision_of(own.path("tour")))
    assert os.listdir(own.folder) == ["other.yaml"]
    own.delete("other", revision_of(own.path("other")))
    assert os.listdir(own.folder) == []


def test_a_draft_is_judged_at_its_fields() -> None:
    assert judge(DATA, DOCKS) == (Mission.model_validate(DATA), [])
    wrong, problems = judge(DATA | {"id": "Tour", "waypoints": [DATA["waypoints"][0] | {"x": "far"}]}, DOCKS)
    assert wrong is None
    assert {item.field: item.where for item in problems} == {
        ("id",): "id",
        ("waypoints", 0, "x"): "waypoint 1 'gate': x",
    }


@pytest.mark.parametrize(
    ("actions", "problem"),
    [
        (("undock", "park"), ""),  # with a wheelchair attached at the start
        (({"dock": "chair_1"}, {"dock": "charger"}), "already carrying a wheelchair"),
        (({"dock": "chair_9"}, "park"), "no dock 'chair_9'"),
        (({"dock": "charger"}, "pass"), "leaves the dock 'charger' without an undock"),
        (("undock", "undock"), "undocks"),
    ],
)
def test_docking_that_cannot_be_is_a_problem_of_its_action(actions: tuple[object, ...], problem: str) -> None:
    stops = [DATA["waypoints"][0] | {"name": str(index), "action": action} for index, action in enumerate(actions)]
    found, problems = judge(DATA | {"waypoints": stops}, DOCKS)
    assert (found is None) == bool(problem)
    if problem:
        assert problem in problems[0].text
        assert problems[0].field[::2] == ("waypoints", "action")
