"""Every page in every language on both screens: no finding of axe-core, minimum sizes, no clipped text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.support.ui_robot import StandInRobot
from tests.ui.conftest import STAFF_PAGES, unlock

AXE = (Path(__file__).parent / "vendor" / "axe.min.js").read_text(encoding="utf-8")
# WCAG 2.2 AA, contrast of AAA (7:1), and axe's best practices.
RULES = """async () => {
    const found = await axe.run(document, {
        runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
        rules: { "color-contrast-enhanced": { enabled: true } },
    });
    if (!found.passes.some(item => item.id === "color-contrast-enhanced")) return ["contrast was not looked at"];
    const places = (item) => item.nodes.map(node => node.html).slice(0, 3).join(" | ");
    return found.violations.map(item => `${item.id}: ${places(item)}`);
}"""
# Of these rules the ones that depend on the layout; texts, names, roles and colours do not.
LAYOUT = """async () => {
    const rules = ["target-size", "scrollable-region-focusable"];
    const found = await axe.run(document, { runOnly: { type: "rule", values: rules } });
    return found.violations.map(item => item.id);
}"""
# Targets are at least 48 px, and no text lies beside its button.
TARGETS = """() => [...document.querySelectorAll("button, input")].filter(item => item.offsetParent).flatMap(item => {
    const { width, height } = item.getBoundingClientRect();
    const cut = item.scrollWidth > item.clientWidth + 1 || item.scrollHeight > item.clientHeight + 1;
    const name = `${item.textContent.trim()} ${Math.round(width)}x${Math.round(height)}`;
    return width < 48 || height < 48 || cut ? [name + (cut ? " cut" : "")] : [];
})"""
# The stop button is fully visible, and the page does not scroll as a whole.
STOP = """() => {
    const box = document.getElementById("stop").getBoundingClientRect();
    const root = document.documentElement;
    const whole = box.top >= 0 && box.bottom <= innerHeight && box.left >= 0 && box.right <= innerWidth;
    return whole && box.width >= 120 && root.scrollWidth <= innerWidth && root.scrollHeight <= innerHeight;
}"""


SIZES = ((1280, 800), (1024, 600), (800, 1280))


def check(page: Any, where: str, sizes: Sequence[tuple[int, int]] = ()) -> None:
    """All of axe-core in the first size, to which the page returns; what depends on the layout in each.

    sizes: without any, the page stays as it is.
    """
    page.mouse.move(0, 0)
    assert page.evaluate(RULES) == [], where
    for width, height in (*sizes[1:], *(sizes[:1] or [page.viewport_size.values()])):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => new Promise(requestAnimationFrame)")
        assert page.evaluate(LAYOUT) == [], f"{where} {width}x{height}"
        assert page.evaluate(TARGETS) == [], f"{where} {width}x{height}"
        assert page.evaluate(STOP), f"{where} {width}x{height}"


@pytest.mark.parametrize(("language", "first"), [("en", 0), ("ja", 1), ("zh-Hans", 2)])
def test_pages_for_everyone(page: Any, robot: StandInRobot, language: str, first: int) -> None:
    sizes = (*SIZES[first:], *SIZES[:first])
    page.set_viewport_size({"width": sizes[0][0], "height": sizes[0][1]})
    page.evaluate(AXE)
    page.click(f'.languages [lang="{language}"]')
    check(page, "destinations", sizes)
    page.click('[data-mission="site_transport"]')
    check(page, "departure", sizes)
    page.click("#start")
    page.wait_for_selector("#pause")
    check(page, "ride", sizes)
    page.click("#abort")
    check(page, "end the ride", sizes)
    page.click(".sure .primary")
    page.click("#stop")
    page.wait_for_selector('[data-page="emergency"]')
    robot.faults = ["LIDAR_TIMEOUT", "BATTERY_LOW"]
    page.wait_for_selector("#call-now")
    check(page, "emergency", sizes)
    page.click("#to-staff")
    page.wait_for_selector('[data-page="pin"]')
    check(page, "PIN", sizes)
    page.click("#to-staff")
    unlock(page)
    for name in STAFF_PAGES:
        page.click(f'[data-nav="{name}"]')
        page.wait_for_selector(f'[data-page="{name}"]')
        check(page, name, sizes)
    page.click('[data-nav="missions"]')
    page.click('[data-file="yard_tour"] [data-act="order"]')
    page.wait_for_selector("#queue [data-order]")
    check(page, "an order", sizes)
    page.click('[data-file="wheelchair_transport"] [data-act="copy"]')
    for step in ("names", "1", "home"):
        page.click(f'[data-step="{step}"]')
        check(page, f"mission editor, {step}", sizes)
    page.click('[data-field="home.x"]')
    page.wait_for_selector(".keyboard")
    check(page, "keys", sizes)


def test_pages_in_the_sun(page: Any, robot: StandInRobot) -> None:
    sizes = (SIZES[0], SIZES[2])
    page.set_viewport_size({"width": 1280, "height": 800})
    page.evaluate(AXE)
    unlock(page)
    page.click('[data-nav="settings"]')
    page.click('[data-choice="contrast-sun"]')
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    robot.faults = ["LIDAR_TIMEOUT", "BATTERY_LOW"]
    for name in STAFF_PAGES:
        page.click(f'[data-nav="{name}"]')
        page.wait_for_selector(f'[data-page="{name}"]')
        check(page, name, sizes)
    page.click("#to-staff")
    page.wait_for_selector("[data-mission]")
    check(page, "destinations", sizes)


def test_pages_on_a_phone(page: Any, robot: StandInRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 844})

    def fits(where: str) -> None:
        assert page.evaluate(TARGETS) == [], where
        assert page.evaluate(STOP), where

    fits("destinations")
    page.click('[data-mission="site_transport"]')
    page.click("#start")
    page.wait_for_selector("#pause")
    fits("ride")
    unlock(page)
    for name in STAFF_PAGES:
        page.click(f'[data-nav="{name}"]')
        page.wait_for_selector(f'[data-page="{name}"]')
        fits(name)
