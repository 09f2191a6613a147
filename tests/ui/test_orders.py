"""Staff order rides by touch, in two languages; a rider lets waiting orders start with one touch."""

from __future__ import annotations

from typing import Any

from custom_msgs.msg import MissionOrder, MissionQueue
from robot_stack.contract import topics
from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import unlock, until

RELEASE, REPLACE = 4, 5


def order(page: Any, mission: str, act: str = "order") -> None:
    page.click(f'[data-file="{mission}"] [data-act="{act}"]')


def rows(page: Any) -> list[str]:
    return list(page.evaluate("[...document.querySelectorAll('#queue [data-order]')].map((row) => row.innerText)"))


def missions_of(robot: StandInRobot) -> list[str]:
    return [item.mission_id for item in robot.queue.orders]


def test_staff_order_move_remove_and_release(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    page.click('[data-nav="missions"]')
    page.wait_for_selector('#queue[data-held="RESTART"]')
    order(page, "site_ride")
    until(page, "document.querySelectorAll('#queue [data-order]').length === 1")
    page.click("#high")
    page.click('[data-delay="30"]')
    order(page, "yard_tour")
    until(page, "document.querySelectorAll('#queue [data-order]').length === 2")
    first, second = robot.queue.orders
    assert (first.mission_id, first.origin, first.priority, first.earliest.sec) == ("site_ride", "touch_screen", 100, 0)
    assert (second.mission_id, second.priority) == ("yard_tour", 200)
    assert second.earliest.sec > 30 * 60
    assert len({first.id, second.id}) == 2
    assert "Site ride" in rows(page)[0]
    assert "priority 200 · not before" in rows(page)[1]

    page.click(f'[data-order="{second.id}"] [data-act="up"]')
    until(page, f"document.querySelector('#queue [data-order]')?.dataset.order === '{second.id}'")
    assert missions_of(robot) == ["yard_tour", "site_ride"]
    page.click(f'[data-order="{second.id}"] [data-act="remove"]')
    until(page, "document.querySelectorAll('#queue [data-order]').length === 1")
    assert missions_of(robot) == ["site_ride"]

    page.click('[lang="ja"]')
    until(page, "document.querySelector('#queue h3')?.textContent === '注文'")
    assert "再起動" in page.inner_text("#queue")
    page.click("#release")
    page.wait_for_selector('#queue[data-held="NOTHING"]')
    page.click("#hold")
    page.wait_for_selector('#queue[data-held="STAFF"]')
    page.click('[data-nav="history"]')
    until(page, "document.querySelector('#history')?.textContent.includes('order yard_tour: answered')")


def test_a_refused_change_of_destination_is_shown(page: Any, robot: StandInRobot) -> None:
    robot.say_ride(state="PAUSED", mission_id="site_ride", current_waypoint="south way")
    unlock(page)
    page.click('[data-nav="missions"]')
    order(page, "yard_tour", "now")
    until(page, "document.querySelector('.toast.bad')?.textContent.includes('no change of destination')")
    assert f"queue {REPLACE} yard_tour" in robot.commands


def test_a_rider_starts_the_waiting_orders_and_cannot_end_a_hold_of_the_staff(page: Any, robot: StandInRobot) -> None:
    unlock(page)
    page.click('[data-nav="missions"]')
    order(page, "site_ride")
    until(page, "document.querySelectorAll('#queue [data-order]').length === 1")
    page.click("#to-staff")
    page.wait_for_selector('[data-page="destinations"] [data-held="RESTART"]')
    assert "Site ride" in page.inner_text("[data-held]")
    page.click("#release")
    wait_for(lambda: f"queue {RELEASE}" in robot.commands, f"the release, received {robot.commands}")
    page.wait_for_selector("[data-held]", state="detached")
    page.click("#to-staff")
    page.click('[data-nav="missions"]')
    page.click("#hold")
    page.wait_for_selector('#queue[data-held="STAFF"]')
    page.click("#to-staff")
    page.wait_for_selector('[data-page="destinations"] [data-held="STAFF"]')
    assert page.query_selector("#release") is None


def test_a_fleet_s_open_route_and_pause_are_shown_and_a_rider_keeps_the_pause(page: Any, robot: StandInRobot) -> None:
    current = MissionOrder(
        id="a", mission_id="tour_7", origin=MissionOrder.FLEET, priority=100, open=True, state=MissionOrder.UNDER_WAY
    )
    robot.queue.current, robot.queue.held_by, robot.queue.paused_by = [current], MissionQueue.NOTHING, "fleet"
    robot.peer.publish(topics.MISSION_QUEUE, robot.queue)
    robot.say_ride(state="PAUSED", mission_id="tour_7", waypoints_completed=2, total_waypoints=5, current_waypoint="")
    page.wait_for_selector('[data-reason="PAUSED_BY_FLEET"]')
    page.click("#keep")
    wait_for(lambda: "PAUSE" in robot.commands, f"the pause, received {robot.commands}")
    robot.queue.paused_by = ""
    robot.peer.publish(topics.MISSION_QUEUE, robot.queue)
    page.wait_for_selector("#keep", state="detached")

    robot.queue.paused_by = "fleet"
    robot.peer.publish(topics.MISSION_QUEUE, robot.queue)
    unlock(page)
    page.click('[data-nav="missions"]')
    page.wait_for_selector('[data-paused-by="fleet"]')
    shown = page.inner_text("[data-current]")
    assert "Under way: tour_7" in shown
    assert "from the fleet · more of the route follows · 2 of 5 stops" in " ".join(shown.split())
    assert "take the robot out of the fleet" in page.inner_text("#queue")
    robot.say_ride(state="WAITING")
    page.click("#to-staff")
    page.wait_for_selector('[data-reason="AWAITS_ROUTE"]')
