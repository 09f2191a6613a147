"""The fleet page without a browser: what it gets of a robot, its texts, its server's settings."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from robot_stack.cli.errors import CommandError
from robot_stack.cli.fleet_page import PAGE, FleetPicture, Wish, server_params, texts
from robot_stack.cli.fleet_robots import STALE_S, Robot, section
from robot_stack.cli.fleet_site import Site
from robot_stack.core.config import load
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.link import Topic
from robot_stack.ui.nodes.server import WEB
from robot_stack.ui.params import TouchUiParams

OWN: dict[str, dict[str, str]] = json.loads((PAGE / "texts.json").read_text(encoding="utf-8"))
CODE = "\n".join(path.read_text(encoding="utf-8") for path in PAGE.glob("*.js"))
ONLINE = {"connectionState": "ONLINE"}


def shown(state: Any = None, *, connection: Any = ONLINE, age_s: float = 0.0, **others: Any) -> dict[str, Any]:
    robot = Robot("uagv/v2/maker/R1", {Topic.CONNECTION: connection})
    if state is not None:
        robot.messages[Topic.STATE] = state
    robot.messages |= {Topic(name): data for name, data in others.items()}
    return section(robot, {Topic.STATE: 100.0, Topic.VISUALIZATION: 99.0}, 100.0 + age_s)


@pytest.mark.parametrize(
    ("state", "condition"),
    [
        (None, "no_state"),
        ({"driving": False}, "idle"),
        ({"driving": False, "batteryState": {"charging": True}}, "charging"),
        ({"driving": False, "nodeStates": [{}]}, "working"),
        ({"driving": False, "actionStates": [{"actionStatus": "RUNNING"}]}, "working"),
        ({"driving": False, "actionStates": [{"actionStatus": "FAILED"}]}, "idle"),
        ({"driving": True, "nodeStates": [{}]}, "driving"),
        ({"driving": True, "paused": True}, "paused"),
        ({"paused": True, "errors": [{"errorLevel": "WARNING"}]}, "paused"),
        ({"paused": True, "errors": [{"errorLevel": "CRITICAL"}]}, "paused"),
        ({"paused": True, "errors": [{"errorLevel": "WARNING"}, {"errorLevel": "FATAL"}]}, "fault"),
        ({"errors": [{"errorLevel": "FATAL"}], "safetyState": {"eStop": "MANUAL"}}, "emergency"),
        ({"safetyState": {"activeEmergencyStop": "MANUAL"}}, "emergency"),
        ({"safetyState": {"eStop": "AUTOACK"}}, "obstacle"),
    ],
)
def test_most_urgent_condition(state: Any, condition: str) -> None:
    assert shown(state)["condition"] == condition


@pytest.mark.parametrize(
    ("connection", "condition"),
    [
        ("OFFLINE", "offline"), ("HIBERNATING", "offline"), ("CONNECTIONBROKEN", "lost"),
        ("CONNECTION_BROKEN", "lost"), ("?", "unknown"), (None, "unknown"),
    ],
)  # fmt: skip
def test_a_robot_that_is_not_online(connection: Any, condition: str) -> None:
    assert shown({"driving": True}, connection={"connectionState": connection})["condition"] == condition


def test_stale_after_the_longest_time_between_states() -> None:
    assert shown({"driving": True}, age_s=STALE_S)["condition"] == "driving"
    found = shown({"driving": True}, age_s=STALE_S + 6.0)
    assert (found["condition"], found["age_s"]) == ("stale", 40)


def test_newest_position_and_the_way_on_its_map() -> None:
    def place(x: float, map_id: str = "yard") -> dict[str, Any]:
        return {"x": x, "y": 2.0, "mapId": map_id}

    state = {
        "orderId": "o-1",
        "lastNodeSequenceId": 2,
        "agvPosition": {**place(1.0), "theta": 3.0 * math.pi / 2.0},
        "nodeStates": [
            {"sequenceId": 8, "released": False, "nodePosition": place(8.0)},
            {"sequenceId": 4, "released": True, "nodePosition": place(4.0)},
            {"sequenceId": 6, "released": True, "nodePosition": place(6.0, "cellar")},
        ],
        "loads": [{}],
    }
    found = shown(state, visualization={"agvPosition": place(9.0)})
    assert found["pose"] == [1.0, 2.0, -1.571], "the state is newer"
    assert found["way"] == [[4.0, 2.0, True], [8.0, 2.0, False]]
    assert (found["progress"], found["left"], found["loaded"], found["open"]) == (0.25, 3, True, True)
    assert shown({"driving": False}, visualization={"agvPosition": place(9.0)})["pose"] == [9.0, 2.0, None]
    assert shown({"orderId": "o-1", "nodeStates": []})["progress"] == 1.0
    assert shown({"nodeStates": []})["progress"] is None


@pytest.mark.parametrize("number", [math.nan, math.inf, 10**400, 1e300, "1", None, True, [1.0]])
def test_wrong_numbers_are_absent(number: Any) -> None:
    state = {
        "orderId": "o-1",
        "lastNodeSequenceId": number,
        "agvPosition": {"x": number, "y": 0.0},
        "batteryState": {"batteryCharge": number},
        "nodeStates": [{"sequenceId": number, "nodePosition": {"x": 0.0, "y": number}}],
    }
    found = shown(state)
    json.dumps(found, allow_nan=False)
    assert (found["pose"], found["battery"], found["way"], found["progress"]) == (None, None, [], 0.0)
    Robot("uagv/v2/maker/R1", {Topic.STATE: state}).row()


def test_only_the_shown_order_of_a_connected_robot_is_cancelled() -> None:
    picture = FleetPicture()
    robot = picture.robots.setdefault("uagv/v2/maker/R1", Robot("uagv/v2/maker/R1", {Topic.CONNECTION: ONLINE}))

    def refusal(order: str, name: str = robot.prefix) -> str:
        return picture.refusal(Wish(name, order, "", lambda _ok, _why: None))

    assert refusal("o-1", "elsewhere") == "fleet.not_online"
    assert refusal("") == "fleet.order_changed", "it has no order"
    robot.messages[Topic.STATE] = {"orderId": "o-2"}
    assert refusal("o-1") == "fleet.order_changed"
    assert refusal("o-2") == ""
    message = {"actions": [{"actionId": "c-1"}]}
    picture.cancelled(robot, message, 10.0)

    def cancel_state(now_s: float = 10.0) -> str:
        return str(picture.sections(now_s)[f"robot:{robot.prefix}"]["cancel"])

    assert [cancel_state(), cancel_state(20.5)] == ["sent", "unanswered"]
    for status, words in (("RUNNING", "running"), ("FAILED", "failed"), ("FINISHED", "finished")):
        robot.messages[Topic.STATE] = {
            "orderId": "o-2",
            "actionStates": [{"actionId": "c-1", "actionStatus": status}],
        }
        assert cancel_state() == words
    robot.messages[Topic.STATE] = {"orderId": "o-3"}
    assert cancel_state() == ""


def test_texts_are_complete_and_used() -> None:
    source = "".join(
        Path(f"robot_stack/cli/{name}.py").read_text(encoding="utf-8") for name in ("fleet_page", "fleet_robots")
    )
    conditions = set(re.findall(r", \"([a-z_]+)\"\)", source)) | {"idle", "online", "offline", "lost", "unknown"}
    for key, entry in OWN.items():
        assert list(entry) == ["en", "ja", "zh"]
        values = {language: sorted(re.findall(r"\{(\w+)\}", text)) for language, text in entry.items()}
        assert values["en"] == values["ja"] == values["zh"], key
        family, _, name = key.partition(".")
        composed = {"condition": name in conditions, "cancel": f'"{name}"' in source}.get(
            family, family in ("error", "mode")
        )
        assert composed or f'"{key}"' in CODE or f'"{key}"' in source, f"{key} is not used"
    named = set(re.findall(r'\bt\("([^"]+)"', CODE)) | set(re.findall(r'"(fleet\.[a-z_]+)"', CODE + source))
    assert named - set(texts()) == set()
    shared = json.loads((WEB / "texts.json").read_text(encoding="utf-8"))
    assert set(OWN) & set(shared) == {"app.title"}, "the page's own title replaces the touch screen's"


def test_every_error_of_this_project_s_robots_has_words() -> None:
    assert {f"error.{kind.value}" for kind in ErrorType} - set(OWN) == set()


def test_other_computers_need_certificate_and_token(tmp_path: Path) -> None:
    screen = load(TouchUiParams, "touch_ui").server
    site = Site(tmp_path / "site")
    own = server_params(screen, site, 8470, None, token=False)
    assert (own.address, own.token, own.tls_certificate) == ("127.0.0.1", "", "")
    assert len(server_params(screen, site, 8470, None, token=True).token) >= 32, "another broker's page, without a site"
    site.prepare(8883, local=True, names=[])
    with pytest.raises(CommandError, match="without --local"):
        server_params(screen, site, 8470, "0.0.0.0", token=True)
    site.prepare(8883, local=False, names=["fleet.example"])
    other = server_params(screen, site, 8470, "0.0.0.0", token=True)
    assert other.host_names[0] == "fleet.example"
    assert other.token
    assert other.token == server_params(screen, site, 8470, "0.0.0.0", token=True).token, "a phone stays admitted"
    assert (tmp_path / "site" / "page_token").stat().st_mode & 0o777 == 0o600
    with pytest.raises(CommandError, match="IP address"):
        server_params(screen, site, 8470, "fleet.example", token=True)
