"""The guided self test by touch and by keyboard, in a real browser against the real node."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.ui_robot import StandInRobot
from tests.support.waiting import wait_for
from tests.ui.conftest import unlock
from tests.ui.test_access_for_all import AXE, check

# --primary of the style sheet, in the order of OpenCV.
PRIMARY_BGR = (99, 74, 11)
STEPS = 21


def at_step(page: Any, step: str) -> None:
    page.wait_for_selector(f'[data-step="{step}"]')


def begin(page: Any, link: str) -> None:
    """Opens the page and begins, once the page has the robot's state."""
    unlock(page)
    page.click(link)
    page.wait_for_selector("#test-start:not([disabled])")

    def running() -> bool:
        page.evaluate("document.getElementById('test-start')?.click()")
        return page.query_selector("[data-step]") is not None

    wait_for(running, "the test to begin", poll_s=0.5)


def filled_share(page: Any) -> float:
    """Share of the drawn progress bar's width that is filled."""
    picture = cv2.imdecode(np.frombuffer(page.locator(".progress").screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    row = picture[picture.shape[0] // 2].astype(int)
    return float(np.mean(np.all(np.abs(row - PRIMARY_BGR) < 12, axis=1)))


def wait_filled(page: Any, share: float) -> None:
    wait_for(lambda: abs(filled_share(page) - share) < 0.03, f"progress of {share:.2f} to be drawn")


@pytest.mark.parametrize(
    ("language", "size", "step"),
    [("ja", (800, 1280), "押してください"), ("zh-Hans", (1024, 600), "请按下紧急停止按钮")],
    ids=["ja", "zh"],
)
def test_self_test_that_fails_and_is_left(
    page: Any, robot: StandInRobot, language: str, size: tuple[int, int], step: str
) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.click(f'.languages [lang="{language}"]')
    page.evaluate(AXE)
    begin(page, '[data-nav="self_test"]')
    at_step(page, "press passenger")
    assert step in page.inner_text("#test-step")
    check(page, "press")
    page.click("#test-fail")
    page.wait_for_selector('#test-result[data-verdict="failed"][data-reason="PERSON"]')
    check(page, "failed")
    page.click('[data-nav="map"]')
    page.wait_for_selector("#self-test-due")
    check(page, "reminder")
    page.click("#self-test-due")
    page.click("#test-start")
    at_step(page, "press passenger")
    robot.press_button()
    at_step(page, "release passenger")
    page.click('[data-nav="map"]')  # leaves the page
    page.click('[data-nav="self_test"]')
    page.wait_for_selector('#test-result[data-verdict="aborted"][data-reason="LEFT"]')
    assert robot.emergency
    assert "stop False" not in robot.commands


def test_whole_self_test(page: Any, robot: StandInRobot) -> None:
    page.evaluate(AXE)
    begin(page, "#self-test-due")
    for number, button in enumerate(("passenger", "left", "right")):
        at_step(page, f"press {button}")
        wait_filled(page, 4 * number / STEPS)
        if number == 0:
            check(page, "press")
        assert not page.query_selector("#test-confirm")
        robot.press_button()
        at_step(page, f"release {button}")
        robot.pressed = False
        at_step(page, f"reset {button}")
        page.focus("#test-confirm")
        page.keyboard.press("Enter")
    at_step(page, "press screen")
    assert robot.emergency is False
    page.click("#stop")
    for name in ("latch", "belt", "safety_edge", "lidars", "brakes"):
        at_step(page, f"check {name}")
        check(page, name)
        page.click("#test-confirm")
    at_step(page, "release screen")
    page.click("#test-confirm")
    at_step(page, "reset screen")
    page.click("#test-confirm")
    page.wait_for_selector('#test-result[data-verdict="passed"]')
    assert "The self test passed." in page.inner_text("#test-result")
    # The page repeats a stop that is not answered at once.
    assert list(dict.fromkeys(robot.commands)) == ["stop True", "EMERGENCY_STOP", "stop False"]
    assert robot.commands[-1] == "stop False"
    assert not robot.emergency
    page.click('[data-nav="map"]')
    page.wait_for_selector("#self-test-due", state="detached")
