"""What can happen to a ride: each case is shown with its cause, and goes on by touch alone."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from custom_msgs.action import Undock
from custom_msgs.msg import MissionOrder, MissionQueue
from robot_stack.contract import topics
from tests.support.docking import FakeDocking
from tests.support.ui_page import web_page
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import port_of, unlock, until

RELEASE, REPLACE = 4, 5


@pytest.fixture
def docking(robot: StandInRobot, url: str) -> Iterator[FakeDocking]:
    """Offers the actions to the screen; the stand-in no longer publishes the state."""
    robot.peer.silence(topics.DOCKING_STATUS)
    docking = FakeDocking()
    docking.error = Undock.Result.UNLATCH_FAILED, "the latch did not open"
    with web_page(port_of(url)) as page:
        page.log_in()
        wait_for(lambda: page.ask("undock")["why"] != "answer.no_docking", "the screen to discover the actions")
    docking.goals.clear()
    yield docking
    docking.close()


def staff(page: Any, name: str) -> None:
    """Opens a page of staff, whose session lasts."""
    if page.query_selector("nav") is None:
        page.click("#to-staff")
        until(page, "document.querySelector('nav') || document.querySelector('#unlock')")
        if page.query_selector("nav") is None:
            page.click("#to-staff")
            unlock(page)
    page.click(f'[data-nav="{name}"]')
    page.wait_for_selector(f'[data-page="{name}"]')


def rider(page: Any) -> None:
    if page.query_selector("nav"):
        page.click("#to-staff")


def rides(robot: StandInRobot, state: str, reason: str) -> None:
    robot.say_ride(state=state, mission_id="site_ride", current_waypoint="south way", reason=reason, last_command="")


def resumes(page: Any, robot: StandInRobot) -> None:
    rider(page)
    robot.commands.clear()
    page.click("#resume")
    wait_for(lambda: "RESUME" in robot.commands, f"RESUME, received {robot.commands}")
    page.wait_for_selector("#pause")


def shows(page: Any, text: str) -> None:
    until(page, f"document.querySelector('[data-why]')?.textContent.includes({text!r})")


def holds(robot: StandInRobot, by: int, *missions: str) -> None:
    robot.queue.held_by, robot.queue.reason = by, ""
    robot.queue.orders = [MissionOrder(id=item, mission_id=item, origin=MissionOrder.FLEET) for item in missions]
    robot.peer.publish(topics.MISSION_QUEUE, robot.queue)


def releases(page: Any, robot: StandInRobot, held_by: str) -> None:
    page.wait_for_selector(f'[data-page="destinations"] [data-held="{held_by}"]')
    robot.commands.clear()
    page.click("#release")
    wait_for(lambda: f"queue {RELEASE}" in robot.commands, f"the release, received {robot.commands}")


def test_a_ride_that_stands_goes_on_by_touch(page: Any, robot: StandInRobot) -> None:
    # a blocked way: another destination, or the end of the ride
    robot.faults = ["COLLISION_IMMINENT"]
    robot.say_limit(0.0, "COLLISION_IMMINENT")
    rides(robot, "RUNNING", "no progress for 60 s, 4.00 m before waypoint 'south way', try 1 of 3")
    page.wait_for_selector('[data-page="ride"] [data-reason="COLLISION_IMMINENT"]')
    shows(page, "try 1 of 3")
    staff(page, "missions")
    shows(page, "try 1 of 3")
    page.click('[data-file="yard_tour"] [data-act="now"]')
    wait_for(lambda: f"queue {REPLACE} yard_tour" in robot.commands, "another destination")
    until(page, "window.touchUi.link.state.ride.mission === 'yard_tour'")
    robot.faults = []
    robot.say_limit(1.5)

    # localization lost: staff set the pose (test_pose_and_goal_on_the_map), and the ride goes on
    rides(robot, "PAUSED", "localization lost: check the pose on the map; RESUME goes on")
    rider(page)
    shows(page, "check the pose on the map")
    staff(page, "map")
    page.wait_for_selector("#tool-pose")
    resumes(page, robot)

    # staff drive by hand, and give the ride back
    page.click("#pause")
    page.wait_for_selector("#resume")
    staff(page, "drive")
    pad = page.locator("#pad").bounding_box()
    page.mouse.move(pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
    page.mouse.down()
    page.mouse.move(pad["x"] + pad["width"] / 2, pad["y"] + 0.1 * pad["height"])
    wait_for(lambda: any(item.twist.linear.x > 0.3 for item in robot.twists), "the robot to be driven")
    page.mouse.up()
    wait_for(lambda: robot.twists[-1].twist.linear.x == 0.0, "standstill")
    resumes(page, robot)

    # an emergency stop: reset, and one touch
    page.click("#stop")
    page.wait_for_selector('[data-page="emergency"]')
    staff(page, "faults")
    page.click("#reset")
    wait_for(lambda: not robot.emergency, "the reset")
    resumes(page, robot)

    # the battery is critical: at a safe place, and charged again
    robot.faults = ["BATTERY_CRITICAL"]
    rides(robot, "PAUSED", "the battery is critical: at porch; charge the robot, then RESUME goes on")
    page.wait_for_selector('[data-reason="BATTERY_CRITICAL"]')
    shows(page, "at porch")
    robot.faults = []
    page.wait_for_selector('[data-reason="BATTERY_CRITICAL"]', state="detached")
    resumes(page, robot)

    # a restart
    rides(robot, "PAUSED", "restarted while RUNNING to 'south way'; RESUME goes on, ABORT ends the mission")
    shows(page, "restarted while RUNNING")
    resumes(page, robot)

    # a low battery after this passenger: no order starts before one touch
    robot.say_ride(state="COMPLETED", reason="")
    holds(robot, MissionQueue.BATTERY_LOW, "yard_tour")
    releases(page, robot, "BATTERY_LOW")


def test_a_failed_docking_is_undocked_and_the_orders_go_on(
    page: Any, robot: StandInRobot, docking: FakeDocking
) -> None:
    why = "docking to chair_1 failed: the latch did not close: inputs closed=0, open=0 (LATCH_FAILED)"
    rides(robot, "FAILED", why)
    robot.say_ride(passenger_attached=True)
    holds(robot, MissionQueue.MISSION_FAILED, "yard_tour")
    page.wait_for_selector('[data-page="destinations"] [data-end="FAILED"]')
    shows(page, "the latch did not close")
    staff(page, "docking")
    page.click("#undock")
    page.click("#undock-yes")
    until(page, "document.querySelector('.toast.bad')?.textContent.includes('the latch did not open')")
    docking.error = None
    page.click("#undock")
    page.click("#undock-yes")
    until(page, "document.querySelector('.toast:not(.bad)')")
    assert docking.goals == [("undock", "")] * 2
    robot.say_ride(passenger_attached=False)
    page.wait_for_selector("#undock", state="detached")
    rider(page)
    releases(page, robot, "MISSION_FAILED")
