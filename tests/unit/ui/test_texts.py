"""The catalogue of texts: every language and fault, no missing or unused text, a font for every character."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args

from robot_stack.contract.faults import FAULTS
from robot_stack.contract.states import HeldBy
from robot_stack.core import mission
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.kept_events import EventState
from robot_stack.core.stop_presence import Presence
from robot_stack.mission.orders import Origin
from robot_stack.recording import black_box
from robot_stack.ui import desk, self_test, view
from robot_stack.ui.lanes import LaneFault
from robot_stack.ui.nodes import hub, lane_file, mission_files, operator_requests, zone_file
from robot_stack.ui.nodes import self_test as self_test_node
from robot_stack.ui.nodes.server import WEB
from robot_stack.ui.params import PersonCheck, StopButton
from robot_stack.ui.self_test import Kind, Reason, Verdict

TEXTS: dict[str, dict[str, str]] = json.loads((WEB / "texts.json").read_text(encoding="utf-8"))
SCRIPTS = [path for path in WEB.rglob("*.js") if "vendor" not in path.parts]
CODE = "\n".join(path.read_text(encoding="utf-8") for path in SCRIPTS)
# Prefixes of keys that scripts compose, with their possible suffixes.
FAMILIES = {
    "fault.": {fault.code for fault in FAULTS},
    "todo.": {fault.code for fault in FAULTS},
    "action.": {"NONE", "WARN", "LIMIT", "STOP", "EMERGENCY_STOP"},
    "level.": {"OK", "WARN", "ERROR", "STALE", "SILENT", "NONE"},
    "dock.": {"IDLE", "APPROACH", "SEARCH", "SERVOING", "FINE_ALIGN", "DOCKED", "FAILED", "UNKNOWN"},
    "reason.": {
        "NO_SAFETY", "NO_MISSION_MANAGER", "PAUSED", "WAITING", "BY_HAND", "RIDE_FAILED", "RIDE_ENDED", "STOPPED",
        "PAUSED_BY_FLEET", "AWAITS_ROUTE", "DOOR", "DOOR_UNANSWERED",
    },
    "nav.": {
        "map", "drive", "docking", "display", "faults", "self_test", "diagnostics", "missions", "history", "recordings",
        "events", "settings",
    },
    "test_verdict.": {verdict.value for verdict in Verdict},
    "test_reason.": {reason.value for reason in Reason},
    "test_button.": {kind.value for kind in Kind} - {"check"},
    "test_screen.": {kind.value for kind in Kind} - {"check"},
    "test_check.": set(get_args(PersonCheck)),
    "test_target.": set(get_args(StopButton)),
    "docking.": {"front", "rear"},
    "presence.": {presence.value for presence in Presence},
    "step.": {kind.value for kind in mission.Kind},
    "dock_kind.": {"wheelchair", "station", "charger"},
    "event_state.": {state.value for state in EventState},
    "event_reason.": {
        black_box.EMERGENCY_STOP, black_box.SAFETY_SILENT, black_box.NODE_RESTARTED, black_box.INTERRUPTED,
    },
    "held.": {held.name for held in HeldBy} - {"NOTHING"},
    "origin.": {origin.value for origin in Origin},
    "zone_kind.": {"keepout", "speed", "one_way"},
    "lane_fault.": {fault.value for fault in LaneFault},
    "settings.": {"normal", "large", "light", "sun", "right", "left"},
}  # fmt: skip


def used() -> set[str]:
    """Returns the keys named or composed by scripts and the node."""
    named = set(re.findall(r'"([a-z]+\.[A-Za-z_]+)"', CODE)) & (set(TEXTS) | set(re.findall(r't\("([^"]+)"', CODE)))
    for beginning, ends in FAMILIES.items():
        assert f"`{beginning}${{" in CODE, f"no script puts {beginning}... together"
        named |= {beginning + end for end in ends}
    answers = {
        value
        for module in (desk, hub, mission_files, operator_requests, self_test, self_test_node, zone_file, lane_file)
        for value in vars(module).values()
        if isinstance(value, str) and value.startswith("answer.")
    }
    return named | answers


def test_no_text_is_missing_and_none_is_unused() -> None:
    assert used() - set(TEXTS) == set()
    assert set(TEXTS) - used() == set()


def test_every_text_in_every_language() -> None:
    for key, entry in TEXTS.items():
        assert list(entry) == ["en", "ja", "zh"], key
        places = {language: sorted(re.findall(r"\{(\w+)\}", text)) for language, text in entry.items()}
        assert all(text.strip() == text and text for text in entry.values()), key
        assert places["en"] == places["ja"] == places["zh"], key


def test_reasons_are_those_that_the_view_gives() -> None:
    source = Path(view.__file__).read_text(encoding="utf-8")
    given = set(re.findall(r'"([A-Z_]+)"', source)) & FAMILIES["reason."]
    assert given == FAMILIES["reason."]


def test_pages_contain_no_hard_coded_text() -> None:
    """Between tags there are only signs, figures and texts of the catalogue."""
    for path in SCRIPTS:
        words = re.findall(r">\s*([A-Za-z][a-z]+(?: [A-Za-z]+)*)\s*</", path.read_text(encoding="utf-8"))
        assert not words, (path.name, words)


def ranges(face: str) -> set[int]:
    match = re.search(r"unicode-range: ([^;]+);", face)
    found: set[int] = set()
    for part in match[1].split(","):
        low, _, high = part.strip().removeprefix("U+").partition("-")
        found |= set(range(int(low, 16), int(high or low, 16) + 1))
    return found


def test_every_character_has_a_font() -> None:
    css = (WEB / "vendor/fonts/fonts.css").read_text(encoding="utf-8")
    faces = re.findall(r"@font-face \{.*?\}", css, re.DOTALL)
    missions = Path("config/missions").glob("*.yaml")
    letters = {ord(letter) for entry in TEXTS.values() for text in entry.values() for letter in text}
    patterns = load_patterns().states.values()
    letters |= {ord(letter) for item in patterns for letter in item.text.en + item.text.ja + item.text.zh}
    letters |= {ord(letter) for path in missions for letter in path.read_text(encoding="utf-8") if letter.isprintable()}
    for family, weight in (("Noto Sans JP", 400), ("Noto Sans SC", 400), ("Noto Sans JP", 700), ("Noto Sans SC", 700)):
        own = [face for face in faces if f"'{family}'" in face and f"font-weight: {weight};" in face]
        assert own
        if weight == 400:
            has = set().union(*map(ranges, own))
            other = "Noto Sans SC" if family.endswith("JP") else "Noto Sans JP"
            rest = [face for face in faces if f"'{other}'" in face and "font-weight: 400;" in face]
            assert not letters - has - set().union(*map(ranges, rest))
    for face in faces:
        file = re.search(r"url\(/vendor/fonts/([^)]+)\)", face)
        assert (WEB / "vendor/fonts" / file[1]).is_file()


def test_vendored_files_have_licences() -> None:
    vendor = WEB / "vendor"
    for name in (
        "LICENSE-htm.txt",
        "LICENSE-preact.txt",
        "fonts/LICENSE-noto-sans-jp.txt",
        "fonts/LICENSE-noto-sans-sc.txt",
    ):
        assert (vendor / name).read_text(encoding="utf-8").strip()
    assert sum(path.stat().st_size for path in vendor.rglob("*") if path.is_file()) < 12_000_000


def test_index_page_preloads_every_module() -> None:
    asked = set(re.findall(r'rel="modulepreload" href="/([^"]+)"', (WEB / "index.html").read_text(encoding="utf-8")))
    modules = {path.relative_to(WEB).as_posix() for path in WEB.rglob("*.js")}
    assert asked == modules - {"app.js", "start.js"}  # named by the page itself
