"""The whole stack in physics, commanded only by touch."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from robot_stack.core.runtime import touch_screen_url
from tests.support.waiting import wait_for
from tests.ui.conftest import PATIENT_S, set_silence_limit, unlock
from tests.ui.conftest import browser as browser

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


@pytest.fixture
def page(stack: StackUnderTest, browser: Any) -> Iterator[Any]:
    url = wait_for(touch_screen_url, "the touch screen's address")
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(120_000)
    page.goto(url)
    page.wait_for_selector("[data-mission]")
    set_silence_limit(page, PATIENT_S)
    yield page
    page.close()


def test_a_ride_is_started_stopped_and_released_by_touch(page: Any, stack: StackUnderTest) -> None:
    """Its pause and its end: tests/simulated/test_touch_screen.py."""
    page.click('[data-mission="short_hop"]')
    page.click("#start")
    wait_for(lambda: stack.speed_mps > 0.3, "the robot to set out")
    page.click("#stop")
    stack.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
    stack.wait_stands(10.0)
    page.wait_for_selector('[data-page="emergency"]')
    unlock(page)
    page.click('[data-nav="faults"]')
    page.click("#reset")
    stack.wait_safety("NORMAL")
    page.click("#to-staff")  # back to the rider's page
    page.wait_for_selector("#resume")
