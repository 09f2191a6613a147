"""Actions of passenger and staff by touch, in a real browser against the real node."""

from __future__ import annotations

import math
import signal
import time
from typing import Any

import pytest

from custom_msgs.msg import EHMIStatus
from robot_stack.contract import topics
from robot_stack.contract.display import Display
from robot_stack.core.stop_presence import Presence
from tests.support.processes import NodeProcess
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import STAFF_PAGES, h2, set_silence_limit, unlock, until


def wait_command(robot: StandInRobot, what: str) -> None:
    wait_for(lambda: what in robot.commands, f"{what}, received {robot.commands}")


def test_a_ride_from_the_first_touch_to_the_end(page: Any, robot: StandInRobot) -> None:
    page.click('[data-mission="wheelchair_transport"]')
    page.click("#start")
    wait_command(robot, "START_MISSION wheelchair_transport")
    wait_for(lambda: robot.languages == ["en"], "the rider's language for the external display")
    page.wait_for_selector('[data-state="RUNNING"]')
    assert "north path" in page.inner_text("h2")
    assert "3 minutes" in page.inner_text(".figures")
    page.click('.languages [lang="ja"]')
    wait_for(lambda: "北の道" in h2(page), "the place's name in Japanese")
    page.click('.languages [lang="en"]')
    page.click("#pause")
    wait_command(robot, "PAUSE")
    page.wait_for_selector('[data-reason="PAUSED"]')  # reason of the stop
    robot.say_ride(last_command="RESUME", last_command_accepted=False, reason="the battery is low")
    page.wait_for_selector('[data-page="ride"] .notice.bad:has-text("the battery is low")')
    page.click("#resume")
    wait_command(robot, "RESUME")
    page.wait_for_selector("#pause")
    page.click("#abort")
    page.click(".sure .primary")  # declines and continues
    assert "ABORT" not in robot.commands
    page.click("#abort")
    page.click("#abort-yes")
    wait_command(robot, "ABORT")
    page.wait_for_selector('[data-end="ABORTED"]')
    robot.say_ride(state="COMPLETED", progress=1.0)
    page.wait_for_selector('[data-end="COMPLETED"]')
    robot.say_ride(last_command="START_MISSION", last_command_accepted=False, reason="no such mission")
    page.wait_for_selector('[data-page="destinations"] .notice.bad:has-text("no such mission")')
    unlock(page)
    page.click('[data-nav="missions"]')
    page.wait_for_selector('[data-page="missions"] .notice.bad:has-text("no such mission")')
    robot.say_ride(last_command="", last_command_accepted=False, reason="")


def test_a_message_that_is_invalid_is_answered(page: Any) -> None:
    answer = page.evaluate("window.touchUi.link.ask({ t: 'start', mission: 3 })")
    assert (answer["t"], answer.get("ok"), answer["why"]) == ("refused", None, "answer.invalid")
    assert answer["detail"].startswith("start.mission: ")


def test_language_and_settings_change_at_once_and_stay_on_this_screen(page: Any, robot: StandInRobot, url: str) -> None:
    for code, said, wanted in (
        ("ja", "どちらへ行きますか？", "Noto Sans JP"),
        ("zh-Hans", "您想去哪里？", "Noto Sans SC"),
        ("en", "Where would you like to go?", "Noto Sans JP"),
    ):
        page.click(f'.languages [lang="{code}"]')
        wait_for(lambda said=said: h2(page) == said, said)
        wait_for(
            lambda code=code: robot.languages[-1:] == [code.removesuffix("-Hans")], "the external display's language"
        )
        assert page.evaluate("document.documentElement.lang") == code
        page.goto(url)
        wait_for(lambda said=said: h2(page) == said, said)

        def drawn_with(wanted: str = wanted) -> list[str]:
            script = "[...document.fonts].filter(face => face.status === 'loaded').map(face => face.family)"
            return [family for family in page.evaluate(script) if wanted in family]

        wait_for(drawn_with, f"{wanted}, served by the node and not found on this machine")

    unlock(page)
    page.click('[data-nav="settings"]')
    page.click('[data-choice="text-large"]')
    page.click('[data-choice="hand-left"]')
    assert page.locator("#stop").bounding_box()["x"] < 300
    page.goto(url)
    page.wait_for_selector("[data-mission]")
    assert page.locator("#stop").bounding_box()["x"] < 300
    assert page.evaluate("getComputedStyle(document.documentElement).fontSize") == "21px"


def test_the_stop_is_on_every_page_and_reset_takes_the_pin(page: Any, robot: StandInRobot) -> None:
    pressed_s = time.monotonic()
    page.click("#stop")
    wait_command(robot, "stop True")
    print(f"click to /emergency_stop, with playwright's own time: {1e3 * (time.monotonic() - pressed_s):.0f} ms")
    page.wait_for_selector('[data-page="emergency"]')
    unlock(page)
    for name in STAFF_PAGES:
        page.click(f'[data-nav="{name}"]')
        page.wait_for_selector(f'[data-page="{name}"]')
        assert page.is_visible("#stop")
        assert page.is_enabled("#stop")
    robot.pressed = True
    page.click('[data-nav="faults"]')
    page.click("#reset")
    until(page, "document.querySelector('.toast')?.textContent.includes('refused: stop button pressed')")
    assert robot.emergency
    robot.pressed = False
    page.click("#reset")
    wait_for(lambda: not robot.emergency, "the reset")
    page.wait_for_selector("#reset", state="detached")


def test_faults_have_advice_and_only_stop_of_gone_or_unknown_source_can_be_cleared(
    page: Any, robot: StandInRobot
) -> None:
    robot.stop_sources = {"ui": Presence.THERE, "panel": Presence.GONE, "unknown": Presence.UNKNOWN}
    robot.emergency = True
    unlock(page)
    page.click('[data-nav="faults"]')
    for name in robot.stop_sources:
        page.wait_for_selector(f'[data-source="{name}"]')
    assert page.locator(".clear").count() == 2
    assert page.locator('[data-source="ui"] .clear').count() == 0
    page.click('[data-source="panel"] .clear')
    wait_command(robot, "clear panel")
    page.wait_for_selector('[data-source="panel"]', state="detached")
    assert robot.emergency  # not a reset
    page.click('[data-source="unknown"] .clear')
    wait_command(robot, "clear unknown")
    page.wait_for_selector('[data-source="unknown"]', state="detached")
    assert page.locator(".clear").count() == 0
    robot.emergency = False
    robot.faults = ["LIDAR_TIMEOUT"]
    robot.say_limit(0.0, "LIDAR_TIMEOUT")
    page.click('[data-nav="faults"]')
    page.wait_for_selector('[data-fault="LIDAR_TIMEOUT"]')
    assert "Check the LiDAR" in page.inner_text('[data-fault="LIDAR_TIMEOUT"]')
    page.click('[data-nav="diagnostics"]')
    until(page, "document.querySelector('#topics')?.textContent.includes('/sensors/imu')")
    row = page.locator("#topics tr", has_text="/sensors/imu").first
    wait_for(lambda: "Stale" in row.inner_text(), "the stale topic")
    page.click("#to-staff")  # texts of the rider's page
    page.wait_for_selector('[data-reason="LIDAR_TIMEOUT"]')


def test_driving_by_hand_ends_with_the_touch_the_focus_or_a_page_that_freezes(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    page.click('[data-nav="drive"]')
    pad = page.locator("#pad").bounding_box()
    x, y = pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, pad["y"] + 0.1 * pad["height"])  # forwards
    wait_for(lambda: any(item.twist.linear.x > 0.3 for item in robot.twists), "the robot to be driven")
    page.mouse.up()
    wait_for(lambda: robot.twists[-1].twist.linear.x == 0.0, "standstill")
    count = len(robot.twists)
    page.click("#mode-side")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(pad["x"] + 0.1 * pad["width"], y)  # to the left
    wait_for(lambda: any(item.twist.linear.y > 0.2 for item in robot.twists[count:]), "sideways")
    page.evaluate("window.dispatchEvent(new Event('blur'))")  # the window loses the focus
    wait_for(lambda: robot.twists[-1].twist.linear.y == 0.0, "standstill")
    page.mouse.up()
    page.click("#mode-turn")
    count = len(robot.twists)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, pad["y"] + 20)
    wait_for(lambda: any(item.twist.linear.x > 0.3 for item in robot.twists[count:]), "the robot to be driven")
    count = len(robot.twists)
    page.evaluate("() => { const end = performance.now() + 1500; while (performance.now() < end); }")  # it freezes
    assert any(item.twist.linear.x == 0.0 for item in robot.twists[count:])
    page.mouse.up()


def drag(page: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drags on the map, in pixels from its middle, where the robot is."""
    box = page.locator("#map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x + start[0], y + start[1])
    page.mouse.down()
    page.mouse.move(x + end[0], y + end[1])
    page.mouse.up()


def test_pose_and_goal_on_the_map(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    page.wait_for_selector("#pose")
    until(page, "window.touchUi.link.state.plan?.points.length > 10")
    page.click("#tool-pose")
    drag(page, (48, 0), (48, -72))  # 24 pixels are a metre: 2 m to the right, heading up
    page.click("#confirm")
    wait_for(lambda: robot.poses, "the pose")
    at = robot.poses[0].pose.pose
    assert (at.position.x, at.position.y) == pytest.approx((4.0, 1.0), abs=0.1)
    assert 2.0 * math.atan2(at.orientation.z, at.orientation.w) == pytest.approx(math.pi / 2, abs=0.1)
    wait_for(lambda: "4.0" in page.inner_text("#pose"), "the page to show the new pose")
    page.click("#tool-goal")
    drag(page, (0, -72), (0, -72))  # 3 m up, without a heading: arrival direction
    page.click("#confirm")
    wait_for(lambda: robot.goals, "the goal")
    goal = robot.goals[0].pose
    # From the robot's position in the middle of the page; each touch deviates by a few pixels.
    above = (at.position.x, at.position.y + 3.0)
    assert (goal.position.x, goal.position.y) == pytest.approx(above, abs=0.1)
    assert 2.0 * math.atan2(goal.orientation.z, goal.orientation.w) == pytest.approx(math.pi / 2, abs=0.1)
    page.click("#cancel-goal")
    wait_for(lambda: len(robot.goals) == 2 and robot.goals[1].header.frame_id == "", "the goal to be taken back")


def colours(page: Any, canvas: str) -> int:
    """Number of colours in a canvas."""
    return int(
        page.evaluate(
            """id => {
                const canvas = document.getElementById(id);
                const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
                return new Set(new Uint32Array(pixels.buffer)).size;
            }""",
            canvas,
        )
    )


# Pixels in the colour of people, who are drawn over nearly white ground.
BROWN = """() => {
    const canvas = document.getElementById('map');
    const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let count = 0;
    for (let i = 0; i < pixels.length; i += 4) {
        count += pixels[i] > 150 && pixels[i] < 195 && pixels[i + 1] > 60 && pixels[i + 1] < 130 && pixels[i + 2] < 80;
    }
    return count;
}"""


def test_the_map_people_and_the_camera_image_are_drawn(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    wait_for(lambda: colours(page, "map") > 20, "map, costmap and obstacles")
    until(page, "document.querySelector('#people').textContent === 'People: 2 (walking: 1), things: 1'")

    def near() -> list[dict[str, Any]]:
        return list(page.evaluate("window.touchUi.link.state.people.near"))

    walking = {"kind": "walking", "at": [3.5, -0.2], "radius": 0.3, "speed": [1.1, 0.3]}  # here odom equals map
    wait_for(lambda: near()[0] == walking, "the person who walks")
    assert [item["speed"] for item in near()[1:]] == [[0.0, 0.0], [0.0, 0.0]]
    before = wait_for(lambda: page.evaluate(BROWN), "them to be drawn")
    page.click('[aria-label="Zoom in"]')
    wait_for(lambda: page.evaluate(BROWN) > 1.3 * before > 260, "them to be drawn larger")
    robot.peer.silence(topics.NAVIGATION_PEOPLE)
    until(page, "window.touchUi.link.state.people.near.length === 0")  # people out of view are removed
    robot.docking.state = "SERVOING"
    robot.docking.position_error = 0.123
    page.click('[data-nav="docking"]')
    wait_for(lambda: colours(page, "camera") > 5, "the camera image")
    until(page, "document.querySelector('dl').textContent.includes('123.0 mm')")
    until(page, "window.touchUi.link.state.markers?.seen.length === 4")


def shown(page: Any) -> str:
    """Title of the image of the external display; empty without an image."""
    return str(page.evaluate("document.querySelector('.display-picture svg title')?.textContent ?? ''"))


def test_the_external_display_is_shown_as_it_has_confirmed(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    page.click('[data-nav="display"]')
    wait_for(lambda: shown(page) == "Driving by itself", "the picture")
    light = "getComputedStyle(document.querySelectorAll('.display-picture rect')[1]).opacity"
    first = page.evaluate(light)
    wait_for(lambda: page.evaluate(light) != first, "the wave to travel")
    page.click('.languages [lang="ja"]')
    wait_for(lambda: shown(page) == "自動走行中", "the picture in Japanese")
    page.click('.languages [lang="en"]')
    robot.display = EHMIStatus(linked=True, acknowledged_state=Display.EMERGENCY_STOP, firmware_fault="LED3")
    wait_for(lambda: shown(page) == "Emergency stop", "the next state")
    assert "LED3" in page.inner_text('[data-page="display"]')
    robot.display = EHMIStatus(linked=False, acknowledged_state=Display.EMERGENCY_STOP)
    until(page, "document.querySelector('#display-link').textContent.includes('does not answer')")
    assert shown(page) == ""  # the last acknowledged state is not displayed
    robot.display = EHMIStatus(linked=True, acknowledged_state=EHMIStatus.NO_STATE)
    until(page, "document.querySelector('#display-link').textContent.includes('Waiting')")
    robot.peer.silence(topics.EHMI_STATUS)
    until(page, "document.querySelector('#display-link').textContent.includes('No report on')")


def test_a_rider_calls_staff_whom_a_wrong_pin_does_not_let_in(page: Any) -> None:
    page.click("#call")
    page.wait_for_selector("#call[disabled]")
    page.click("#to-staff")
    for digit in "1111":
        page.click(f'[data-key="{digit}"]')
    page.click("#unlock")
    until(page, "document.querySelector('.pin [role=status]').textContent === 'Wrong PIN.'")
    assert not page.query_selector("nav")
    page.click("#to-staff")
    unlock(page)
    page.click('[data-nav="faults"]')
    page.click("#call-done")
    page.wait_for_selector("#call:not([disabled])")


def test_a_page_that_lost_its_link_shows_it_and_keeps_only_the_stop(
    page: Any, robot: StandInRobot, screen: NodeProcess, url: str
) -> None:
    set_silence_limit(page, 2.0)
    screen.signal(signal.SIGSTOP)  # the node hangs with its sockets open
    page.wait_for_selector(".lost")
    assert page.evaluate("window.touchUi.link.send({t: 'pause'}) && !window.touchUi.link.lost") is False
    page.click("#stop")
    until(page, "document.querySelector('.lost').textContent.includes('stop will be sent')")
    screen.signal(signal.SIGCONT)
    wait_command(robot, "stop True")
    page.wait_for_selector(".lost", state="detached")
    page.wait_for_selector('[data-page="emergency"]')
    until(page, "!window.touchUi.link.stopWaits")
    assert "PAUSE" not in robot.commands


def test_a_page_of_which_a_file_was_lost_comes_up_by_itself(browser: Any, robot: StandInRobot, url: str) -> None:
    """As if the robot restarts while its kiosk loads the page."""
    context = browser.new_context()
    context.clock.install()
    pages = {file: context.new_page() for file in ("pages/rider.js", "texts.json")}
    for file, page in pages.items():
        page.route(f"**/{file}", lambda route: route.abort())
        page.goto(url)
        until(page, "document.readyState === 'complete'")
        assert page.evaluate("document.querySelector('#app').textContent") == "", file
        page.unroute(f"**/{file}")
    context.clock.fast_forward(10_000)
    for page in pages.values():
        page.wait_for_selector("[data-mission]")
    context.close()
