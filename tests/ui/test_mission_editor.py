"""Staff edit a mission by touch: fields are validated, the mission is saved to a file and never overwrites another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.core.docks import load_docks
from robot_stack.core.mission_library import read_mission
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import unlock, until


@pytest.fixture
def own(shared_folder: Path) -> Iterator[Path]:
    """The folder of missions made on the touch screen, empty."""
    folder = shared_folder / "data" / "robot_stack" / "missions"
    yield folder
    for file in folder.glob("*"):
        file.unlink()


@pytest.fixture
def editor(page: Any, own: Path) -> Any:
    """The staff's page of missions, without any of their own."""
    unlock(page)
    page.click('[data-nav="missions"]')
    page.wait_for_selector('[data-file="site_ride"]')
    page.wait_for_selector('[data-act="delete"]', state="detached")
    return page


def fill(page: Any, field: str, text: str) -> None:
    page.fill(f'[data-field="{field}"]', text)


def place_on_map(page: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A touch and a drag on the editor's map, in fractions of its size."""
    box = page.locator("#mission-map").bounding_box()
    page.mouse.move(box["x"] + start[0] * box["width"], box["y"] + start[1] * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + end[0] * box["width"], box["y"] + end[1] * box["height"])
    page.mouse.up()


def save(page: Any) -> None:
    page.click("#save-mission")
    page.wait_for_selector("[data-editor]", state="detached")


def compose(page: Any, name: str = "Garden tour") -> None:
    """A new mission of two stops, not saved yet."""
    page.click("#new-mission")
    fill(page, "name.en", name)
    page.click("#add-here")
    page.click("#add-known")
    page.click('[data-place="fountain"]')


def test_a_mission_is_made_started_and_offered_to_riders(editor: Any, robot: StandInRobot, own: Path) -> None:
    compose(editor)
    editor.click("#add-on-map")
    place_on_map(editor, (0.5, 0.5), (0.5, 0.2))
    editor.click('[data-kind="wait"]')
    fill(editor, "waypoints.2.action.wait_s", "7.5")
    editor.click("#add-known")
    editor.click('[data-place="chair_1"]')
    save(editor)
    mission = read_mission(own / "garden_tour.yaml")
    assert mission.name.model_dump() == {"en": "Garden tour", "ja": "Garden tour", "zh": "Garden tour"}
    assert [item.name for item in mission.waypoints] == ["stop", "fountain", "stop 2", "chair_1"]
    assert (mission.waypoints[0].x, mission.waypoints[0].y) == (2.0, 1.0)  # the robot's position
    assert (mission.waypoints[1].x, mission.waypoints[1].y) == (11.0, 10.0)
    assert mission.waypoints[2].action.wait_s == 7.5
    assert mission.waypoints[2].yaw == pytest.approx(1.5708, abs=0.05)  # dragged upwards
    assert mission.waypoints[3].action.dock_id == "chair_1"
    editor.click('[data-file="garden_tour"] [data-act="start"]')
    wait_for(lambda: "START_MISSION garden_tour" in robot.commands, f"the start, received {robot.commands}")
    robot.say_ride(state="COMPLETED")
    editor.click("#to-staff")
    editor.wait_for_selector('[data-mission="garden_tour"]')


def test_editor_errors_are_shown_at_their_field(editor: Any, own: Path) -> None:
    compose(editor)
    save(editor)
    editor.click('[data-file="garden_tour"] [data-act="open"]')
    editor.click('[data-step="1"]')
    fill(editor, "waypoints.1.x", "far")
    until(editor, "document.querySelector('[data-problem=\"waypoints.1.x\"]')?.textContent.includes('valid number')")
    assert editor.get_attribute('[data-field="waypoints.1.x"]', "aria-invalid") == "true"
    fill(editor, "waypoints.1.x", "20000")
    until(editor, "document.querySelector('[data-problem=\"waypoints.1.x\"]')?.textContent.includes('10000')")
    fill(editor, "waypoints.1.x", "11")
    editor.wait_for_selector("[data-problem]", state="detached")
    editor.click('[data-step="0"]')
    editor.click('[data-kind="dock"]')
    editor.click('[data-dock="charger"]')
    editor.click('[data-step="1"]')  # drives without undocking: the mission manager would refuse it
    until(editor, "document.querySelector('[data-problem=\"waypoints.1.action\"]')?.textContent.includes('undock')")
    fill(editor, "waypoints.1.name", "stop")
    editor.click("#save-mission")
    until(editor, "document.querySelector('.toast.bad')?.textContent.includes('has errors')")
    assert [item.name for item in read_mission(own / "garden_tour.yaml").waypoints] == ["stop", "fountain"]
    editor.click("#leave-editor")
    editor.click("#discard")
    editor.wait_for_selector("[data-editor]", state="detached")


def test_a_charger_is_chosen_as_home_and_left_out_again(editor: Any, own: Path) -> None:
    compose(editor)
    editor.click('[data-step="home"]')
    assert editor.get_attribute('[data-home-dock=""]', "aria-pressed") == "true"
    assert editor.query_selector('[data-home-dock="chair_1"]') is None  # only chargers are offered
    editor.click('[data-home-dock="charger"]')
    until(editor, "document.querySelector('[data-home-dock=\"charger\"]').getAttribute('aria-pressed') === 'true'")
    fill(editor, "home.y", "0.5")
    save(editor)
    staging = load_docks().docks["charger"].staging
    home = read_mission(own / "garden_tour.yaml").home
    assert (home.dock, home.x, home.y) == ("charger", pytest.approx(staging.x_m, abs=1e-3), 0.5)
    editor.click('[data-file="garden_tour"] [data-act="open"]')
    editor.click('[data-step="home"]')
    editor.click('[data-home-dock=""]')
    save(editor)
    left = read_mission(own / "garden_tour.yaml").home
    assert (left.dock, left.x, left.y) == ("", home.x, home.y)


def test_stops_are_moved_and_removed_and_the_mission_renamed_and_deleted(editor: Any, own: Path) -> None:
    compose(editor)
    save(editor)
    editor.click('[data-file="garden_tour"] [data-act="open"]')
    editor.click('[data-step="1"]')
    editor.click("#step-up")
    editor.click('[data-step="1"]')
    editor.click("#step-remove")
    editor.click('[data-step="names"]')
    fill(editor, "name.ja", "庭")
    fill(editor, "id", "garden")
    save(editor)
    assert [path.name for path in own.iterdir()] == ["garden.yaml"]
    mission = read_mission(own / "garden.yaml")
    assert [item.name for item in mission.waypoints] == ["fountain"]
    assert mission.name.ja == "庭"
    editor.wait_for_selector('[data-file="garden"]')
    editor.click('[data-file="garden"] [data-act="delete"]')
    editor.click('[data-act="delete-yes"]')
    editor.wait_for_selector('[data-file="garden"]', state="detached")
    assert list(own.iterdir()) == []
    editor.click('[data-nav="history"]')
    until(editor, "document.querySelector('#history')?.textContent.includes('delete mission garden')")
    history = editor.inner_text("#history")
    assert "save mission garden (was garden_tour)" in history


def test_nothing_is_overwritten_unseen(editor: Any, own: Path) -> None:
    compose(editor, "Site ride")  # the name of a mission in the installation
    editor.click("#save-mission")
    editor.click('[data-step="names"]')
    editor.wait_for_selector('[data-problem="id"]')
    fill(editor, "id", "my_ride")
    save(editor)
    editor.click('[data-file="my_ride"] [data-act="open"]')
    file = own / "my_ride.yaml"
    changed = yaml.safe_load(file.read_text(encoding="utf-8"))
    changed["name"]["en"] = "Changed by somebody else"
    file.write_text(yaml.safe_dump(changed, allow_unicode=True), encoding="utf-8")
    editor.click("#save-mission")
    until(editor, "document.querySelector('.toast.bad')?.textContent.includes('changed elsewhere')")
    assert read_mission(file).name.en == "Changed by somebody else"
    assert editor.is_visible("[data-editor]")  # the input is kept


def test_missions_of_the_software_are_looked_at_and_copied(editor: Any, own: Path) -> None:
    editor.click('[data-file="wheelchair_transport"] [data-act="open"]')
    editor.wait_for_selector("[data-editor]")
    assert not editor.query_selector("#save-mission")
    assert editor.is_disabled('[data-field="waypoints.0.x"]')
    editor.click('[data-step="1"]')
    assert editor.get_attribute('[data-kind="dock"]', "aria-pressed") == "true"
    editor.click("#leave-editor")
    editor.click('[data-file="wheelchair_transport"] [data-act="copy"]')
    save(editor)
    copied = read_mission(own / "wheelchair_transport_copy.yaml")
    assert copied.name.model_dump() == {
        "en": "Copy of Wheelchair transport",
        "ja": "車いす搬送のコピー",
        "zh": "轮椅接送 副本",
    }
    assert len(copied.waypoints) == 11


def test_names_are_typed_on_the_screen_and_a_draft_outlives_another_page(editor: Any) -> None:
    editor.click("#new-mission")
    editor.click('[data-field="name.en"]')
    editor.click('[data-type="shift"]')
    for letter in "garten":
        editor.click(f'[data-type="{letter}"]')
    editor.click('[data-type="delete"]')
    editor.click('[data-type="space"]')
    editor.click('[data-type="2"]')
    until(editor, "document.querySelector('[data-field=\"name.en\"]').value === 'Garte 2'")
    assert editor.input_value('[data-field="id"]') == "garte_2"
    editor.click('[data-type="close"]')
    editor.wait_for_selector(".keyboard", state="detached")
    editor.click('[data-nav="map"]')
    editor.click('[data-nav="missions"]')
    until(editor, "document.querySelector('[data-field=\"name.en\"]')?.value === 'Garte 2'")
