"""The touch screen: from a click in Chromium to the engine's stop, page load, processor, memory, hostile requests."""

from __future__ import annotations

import importlib.util
import json
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import psutil

from robot_stack.core.runtime import touch_screen_url
from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile
from tests.benchmarks.support.stack import cpu_pct, pss_mb, running_stack
from tests.benchmarks.support.trial import run_trial

if TYPE_CHECKING:
    from tests.benchmarks.nodes.ui_witness import UiWitness

AIMS = {
    "estop_click_to_engine_stop_ms_p99": Aim("<", 100.0),
    "page_load_ms_p50": Aim("<", 1500.0),
    "idle_cpu_pct": Aim("<", 1.0),
    "map_page_cpu_pct": Aim("<", 10.0),
    "map_page_pss_mb": Aim("<", 120.0),
    "missing_texts": Aim("<=", 0.0),
    "hostile_requests": Aim(">=", 10_000),
    "state_changes_by_them": Aim("<=", 0.0),
    "hostile_accepted": Aim("<=", 0.0),
    "hostile_server_errors": Aim("<=", 0.0),
    "hostile_unanswered": Aim("<=", 0.0),
    "hostile_crashes": Aim("<=", 0.0),
}
_PIN = "2468"  # of the profile sim
_TRIAL, _TRIAL_S = "tests.benchmarks.nodes.ui_trial", 1800.0
_DEADLINE_S = 20.0
_OPTIONS = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
_PRESSED = """() => { window.pressedMs = [];
    document.addEventListener("pointerdown", event => event.target.closest("#stop")
        && window.pressedMs.push(performance.timeOrigin + event.timeStamp), true); }"""


def run(clicks: int = 100, loads: int = 10, watch_s: float = 15.0, hostile: int = 10_000, seed: int = 1) -> Result:
    """In the simulation on the system clock. clicks: on the stop; loads: of the rider's page.

    watch_s: window for processor and memory. hostile: requests that must change nothing, to a touch-screen process
    alone.
    """
    from tests.benchmarks.nodes.ui_witness import UiWitness

    chromium = _chromium_path()
    attacked = run_trial(_TRIAL, lambda _: [str(hostile), str(seed)], _TRIAL_S)
    with running_stack("sim", ["sim_world.people=false"], system_time=True) as status:
        process = next(psutil.Process(item["pid"]) for item in status["processes"] if item["name"] == "touch_ui")
        url = _served()
        idle = _load(process, watch_s)
        with UiWitness() as witness, _chromium(chromium) as browser:
            load_ms = [_page_load_ms(browser, url) for _ in range(loads)]
            page = _staff(browser, url)
            map_page = _load(process, watch_s)
            stops_ms = [_stop_ms(page, witness) for _ in range(clicks)]
    return Result(
        {
            "estop_click_to_engine_stop_ms_p99": percentile(stops_ms, 0.99),
            "estop_click_to_engine_stop_ms_p50": percentile(stops_ms, 0.5),
            "page_load_ms_p50": percentile(load_ms, 0.5),
            "idle_cpu_pct": idle[0],
            "idle_pss_mb": idle[1],
            "map_page_cpu_pct": map_page[0],
            "map_page_pss_mb": map_page[1],
            "missing_texts": _missing_texts(),
            **attacked,
        },
        {"clicks": clicks, "loads": loads, "profile": "sim on the system clock", "watch_s": watch_s},
    )


def _chromium_path() -> str:
    if importlib.util.find_spec("playwright") is None:
        raise BenchError("needs playwright, of the development packages")
    path = shutil.which("chromium")
    if path is None:
        raise BenchError("needs a Chromium: install the package chromium")
    return path


@contextmanager
def _chromium(path: str) -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=_OPTIONS)
        yield browser
        browser.close()


def _served() -> str:
    found: list[str] = []

    def look() -> bool:
        found.extend(filter(None, [touch_screen_url()]))
        return bool(found)

    _wait(look, "the touch screen's address")
    return found[0]


def _load(process: psutil.Process, seconds: float) -> tuple[float, float]:
    """(percent of a core, MB) of a process."""
    return cpu_pct(process, seconds), pss_mb(process)


def _page_load_ms(browser: Any, url: str) -> float:
    """Until the rider's page shows the robot's state, in a fresh browser context."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    begun_s = time.monotonic()
    page.goto(url)
    page.wait_for_selector("main:not(.behind) [data-page]")
    loaded_ms = 1e3 * (time.monotonic() - begun_s)
    context.close()
    return loaded_ms


def _staff(browser: Any, url: str) -> Any:
    """Opens the map page, unlocked for staff."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(url)
    page.wait_for_selector("main:not(.behind) [data-page]")
    page.evaluate(_PRESSED)
    page.click("#to-staff")
    for digit in _PIN:
        page.click(f'[data-key="{digit}"]')
    page.click("#unlock")
    page.wait_for_selector('[data-page="map"]')
    _release(page)  # a stack killed during an emergency stop starts in one
    return page


def _release(page: Any) -> None:
    _wait(lambda: page.evaluate("window.touchUi.link.ask({t: 'reset'})")["ok"], "the reset")


def _stop_ms(page: Any, witness: UiWitness) -> float:
    """From the browser's own time of the touch to the engine's stop. Releases it again."""
    _wait(lambda: not witness.engine_stopped, "the engine to be released")
    witness.watch()
    page.click("#stop")
    _wait(lambda: witness.stopped_s is not None, "the engine's stop")
    pressed_ms = float(page.evaluate("window.pressedMs.at(-1)"))
    assert witness.stopped_s is not None
    _release(page)
    return 1e3 * witness.stopped_s - pressed_ms


def _missing_texts() -> int:
    from robot_stack.ui.nodes.server import WEB

    texts = json.loads(Path(WEB / "texts.json").read_text(encoding="utf-8"))
    return sum(not entry.get(language) for entry in texts.values() for language in ("en", "ja", "zh"))


def _wait(condition: Callable[[], Any], what: str) -> None:
    end_s = time.monotonic() + _DEADLINE_S
    while not condition():
        if time.monotonic() > end_s:
            raise BenchError(f"timed out after {_DEADLINE_S:.0f} s waiting for {what}")
        time.sleep(0.005)
