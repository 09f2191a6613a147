"""Staff see, draw and delete zones and lanes of the site on the map page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from robot_stack.core.route_graph import load_graph
from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE, ZoneType, load_zones
from robot_stack.ui.pin import hash_pin
from tests.support.processes import NodeProcess, Start
from tests.support.ui_page import PIN
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import unlock, until
from tests.ui.test_access_for_all import AXE, SIZES, check


@pytest.fixture(scope="module")
def folder(shared_folder: Path) -> Path:
    return Path(shutil.copytree(map_folder("yard"), shared_folder / "yard"))


@pytest.fixture(scope="module")
def screen(shared_start: Start, browser: Any, folder: Path) -> NodeProcess:
    lawn = {
        "type": "Feature",
        "properties": {"name": "lawn", "type": "keepout"},
        "geometry": {"type": "Polygon", "coordinates": [[[5, 5], [7, 5], [7, 7], [5, 5]]]},
    }
    (folder / ZONES_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": [lawn]}))
    pin = f"access.pin_hash:='{hash_pin(PIN)}'"
    process = shared_start("touch_ui", "-p", "server.port:=0", "-p", pin, "-p", f"pages.map:='{folder}'")
    process.wait_output("serving http")
    return process


# Pixels in the colour of the corners that were touched.
CORNERS = """() => {
    const canvas = document.getElementById('map');
    const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    return pixels.reduce((count, pixel) => count + ((pixel & 0xffffff) === 0x003b8a), 0);
}"""


def touch(page: Any, *places: tuple[float, float]) -> None:
    """Touches the map, in pixels from its middle."""
    box = page.locator("#map").bounding_box()
    for x, y in places:
        page.touchscreen.tap(box["x"] + box["width"] / 2 + x, box["y"] + box["height"] / 2 + y)


def names(page: Any) -> list[str]:
    return list(page.evaluate("window.touchUi.link.state.zones.zones.map((zone) => zone.name)"))


def test_zones_are_drawn_saved_and_deleted(page: Any, robot: StandInRobot, folder: Path) -> None:
    unlock(page)
    until(page, "document.querySelector('#zones')?.textContent === 'Zones: 1, lanes: 0'")
    page.click("#tool-zone")
    page.click('[data-kind="one_way"]')
    assert page.is_disabled("#zone-save")
    touch(page, (40, 60), (40, 60), (40, 140), (100, 140), (120, 40))  # a double touch is one corner
    until(page, "document.querySelector('.zone-form').textContent.includes(': 4.')")
    page.click("#zone-undo")
    until(page, "document.querySelector('.zone-form').textContent.includes(': 3.')")
    wait_for(lambda: page.evaluate(CORNERS) > 200, "the corners on the map")
    page.evaluate(AXE)
    check(page, "the form of a zone")
    page.click("#zone-save")
    wait_for(lambda: names(page) == ["lawn", "one_way 1"], "the new zone")
    _, lane = load_zones(str(folder))
    assert lane.type is ZoneType.ONE_WAY
    assert abs(lane.heading_rad + 1.5708) < 0.05, "from the first corner to the second, downwards on the screen"
    assert len(lane.rings[0]) == 4
    until(page, "document.querySelector('#zones-changed') !== null")
    page.click('[data-kind="speed"]')
    page.click('[data-speed="0.6"]')
    touch(page, (-120, 60), (-60, 60), (-60, 120))
    page.click("#zone-save")
    wait_for(lambda: names(page) == ["lawn", "one_way 1", "speed 1"], "the second zone")
    assert load_zones(str(folder))[2].speed_mps == 0.6
    page.click('[data-delete="lawn"]')
    page.click('[data-delete-yes="lawn"]')
    wait_for(lambda: names(page) == ["one_way 1", "speed 1"], "the zone to be gone")
    assert [zone.name for zone in load_zones(str(folder))] == ["one_way 1", "speed 1"]
    page.click('[data-nav="history"]')
    until(page, "document.body.textContent.includes('delete zone lawn')")


def problems(page: Any) -> list[str]:
    return list(page.evaluate("[...document.querySelectorAll('[data-problem]')].map((item) => item.dataset.problem)"))


def lanes(page: Any) -> list[Any]:
    return list(page.evaluate("window.touchUi.link.state.zones.lanes.list"))


def test_lanes_are_drawn_checked_saved_and_deleted(page: Any, robot: StandInRobot, folder: Path) -> None:
    unlock(page)
    page.click("#tool-lane")
    assert page.is_disabled("#lane-save")
    touch(page, (-40, 60), (-40, 60), (-40, 120))  # a double touch is one point
    wait_for(lambda: page.is_enabled("#lane-save"), "the check of the lane")
    page.click('[data-both="no"]')
    page.click('[data-speed="0.4"]')
    page.evaluate(AXE)
    check(page, "the form of a lane", SIZES)
    page.click("#lane-save")
    wait_for(lambda: len(lanes(page)) == 1, "the lane")
    assert [(lane["both"], lane["speed"]) for lane in lanes(page)] == [(False, 0.4)]
    page.click('[data-both="yes"]')
    touch(page, (-38, 118), (80, 20))  # from the node to the other side of a wall
    wait_for(lambda: problems(page) == ["obstacle"], "the place that is wrong")
    assert page.is_disabled("#lane-save")
    page.click("#lane-undo")
    wait_for(lambda: not problems(page), "the wrong point to be gone")
    page.focus("#map")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")  # a point at the middle, 1 m beside the robot
    page.focus("#lane-save")
    wait_for(lambda: page.is_enabled("#lane-save"), "the check of the second lane")
    page.keyboard.press("Enter")
    wait_for(lambda: len(lanes(page)) == 2, "the second lane")
    graph = load_graph(str(folder))
    assert graph is not None
    assert (len(graph.points), graph.ends.tolist()) == (3, [[0, 1], [1, 2], [2, 1]]), "joined at the node"
    assert abs(graph.points[2] - (1.0, 1.0)).max() < 0.1
    until(page, "document.querySelector('#zones-changed') !== null")
    touch(page, (-150, -60), (-150, -120))
    wait_for(lambda: "unconnected" in problems(page), "the lane to be found unconnected")
    first = lanes(page)[0]["id"]
    page.click(f'[data-delete="{first}"]')
    page.click(f'[data-delete-yes="{first}"]')
    wait_for(lambda: len(lanes(page)) == 1, "the lane to be gone")
    page.click('[data-nav="history"]')
    until(page, f"document.body.textContent.includes('delete lane {first}')")
