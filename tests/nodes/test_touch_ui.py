"""The touch screen's node over a real WebSocket, with real DDS peers in place of the robot."""

from __future__ import annotations

import http.client
import json
import random
import shutil
import signal
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Image
from std_msgs.msg import Bool
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from custom_msgs.msg import MissionStatus, SafetyStatus, UICommand
from robot_stack.contract import topics
from robot_stack.core.point_cloud import Points
from robot_stack.core.runtime import runtime_dir, touch_screen_url
from robot_stack.middleware.point_cloud import cloud_message
from robot_stack.ui import frames
from robot_stack.ui.pin import hash_pin
from robot_stack.ui.protocol import Layer
from tests.support.fake_safety import FakeSafety
from tests.support.processes import Start
from tests.support.ui_page import PIN, WebPage, web_page
from tests.support.waiting import wait_for
from tests.unit.ui.test_protocol import GOOD, mutate

if TYPE_CHECKING:
    from tests.support.peer import Peer, Received


class TouchScreen:
    """The node, its port, and its messages to the robot."""

    def __init__(self, start: Start, peer: Peer, *arguments: str) -> None:
        self.stops: Received = peer.listen(topics.EMERGENCY_STOP)
        self.commands: Received = peer.listen(topics.UI_COMMAND)
        self.teleop: Received = peer.listen(topics.TELEOP_CMD_VEL)
        self.poses: Received = peer.listen(topics.INITIAL_POSE)
        self.goals: Received = peer.listen(topics.GOAL_POSE)
        self.beats: Received = peer.listen(topics.UI_HEARTBEAT)
        pin = f"access.pin_hash:='{hash_pin(PIN)}'"
        self.process = start("touch_ui", "-p", "server.port:=0", "-p", pin, "-p", "pages.map:=''", *arguments)
        self.process.wait_output("serving http")
        self.port = int(self.process.output().split("serving http")[1].split("/")[2].split(":")[1])

        rows = (topics.EMERGENCY_STOP, topics.UI_COMMAND, topics.TELEOP_CMD_VEL, topics.GOAL_POSE, topics.INITIAL_POSE)

        def all_there() -> bool:
            named = [{item.node_name for item in peer.node.get_publishers_info_by_topic(row.name)} for row in rows]
            return all("touch_ui" in nodes for nodes in named)

        wait_for(all_there, "the node's publishers")

    @property
    def arrived(self) -> tuple[Received, ...]:
        return (self.stops, self.commands, self.teleop, self.poses, self.goals)


@pytest.fixture(scope="module")
def shared_screen(shared_start: Start, shared_peer: Peer) -> TouchScreen:
    return TouchScreen(shared_start, shared_peer)


@pytest.fixture
def screen(shared_screen: TouchScreen) -> TouchScreen:
    """Has received nothing yet, and is not pressed."""
    with web_page(shared_screen.port) as page:
        if any(message.data for message in shared_screen.stops.messages[-1:]):
            page.log_in().ask("reset")
            shared_screen.stops.wait(lambda message: not message.data, "the release")
    for arrived in shared_screen.arrived:
        arrived.items.clear()
    return shared_screen


@pytest.fixture
def robot(screen: TouchScreen) -> Iterator[Peer]:
    """The other nodes of the robot."""
    from tests.support.peer import Peer

    made = Peer("robot")
    yield made
    made.close()


@pytest.fixture
def rider(screen: TouchScreen) -> Iterator[WebPage]:
    with web_page(screen.port) as page:
        yield page


@pytest.fixture
def staff(screen: TouchScreen) -> Iterator[WebPage]:
    with web_page(screen.port) as page:
        yield page.log_in()


def test_every_command_of_a_rider(screen: TouchScreen, rider: WebPage) -> None:
    assert rider.ask("start", mission="site_ride")["ok"]
    for t in ("pause", "resume", "abort"):
        assert rider.ask(t)["ok"]
    wait_for(lambda: len(screen.commands.items) == 4, "four commands")
    assert [(item.command_type, item.mission_id) for item in screen.commands.messages] == [
        (UICommand.START_MISSION, "site_ride"),
        (UICommand.PAUSE, ""),
        (UICommand.RESUME, ""),
        (UICommand.ABORT, ""),
    ]
    assert rider.ask("call", on=True)["ok"]
    rider.wait("staff", "called", True)


def test_staff_can_clear_stop_of_gone_source(screen: TouchScreen, rider: WebPage, robot: Peer) -> None:
    safety = FakeSafety(robot)
    rider.wait("safety", "state", "NORMAL")
    assert rider.ask("clear_stop", source="panel")["why"] == "answer.needs_staff"
    rider.log_in()
    wait_for(lambda: rider.ask("clear_stop", source="panel")["ok"], "the safety monitor's service")
    safety.uncleared = "refused: ui is running and reports that it is pressed: release it there"
    refused = rider.ask("clear_stop", source="ui")
    assert (refused["ok"], refused["detail"]) == (False, safety.uncleared)
    assert safety.cleared[-2:] == ["panel", "ui"]
    assert screen.stops.items == []  # a clear neither stops nor releases


def test_reset_without_a_safety_monitor(screen: TouchScreen, staff: WebPage) -> None:
    for asked in ({"t": "reset"}, {"t": "clear_stop", "source": "panel"}):
        # The monitor of an earlier test may still be known.
        wait_for(lambda asked=asked: staff.ask(**asked)["why"] == "answer.no_monitor", f"no monitor: {asked}")


def test_a_finger_drives_and_a_page_that_vanishes_stops(screen: TouchScreen) -> None:
    with web_page(screen.port) as page:
        page.log_in()

        def driven() -> bool:
            page.say("pad", x=1.0, y=0.0, turn=0.0, at_ms=1e3 * time.monotonic())
            return any(item.twist.linear.x > 0.0 for item in screen.teleop.messages)

        wait_for(driven, "motion", poll_s=0.1)  # a busy node refuses a touch that has become old
    screen.teleop.wait(lambda message: message.twist.linear.x == 0.0, "standstill")


def test_page_receives_state_updates_and_only_changes(screen: TouchScreen, rider: WebPage, robot: Peer) -> None:
    rider.wait("stand", "reasons", ["NO_SAFETY"])
    safety = SafetyStatus(safety_state="DEGRADED", active_faults=["BATTERY_LOW"], min_obstacle_distance=2.0)
    robot.repeat(topics.SAFETY_STATUS, lambda: safety, 10.0)
    robot.publish(topics.MISSION_STATUS, MissionStatus(state="RUNNING", mission_id="tour", eta_s=61.0, progress=0.5))
    pose = PoseStamped()
    pose.pose.position.x, pose.pose.orientation.w = 3.0, 1.0
    robot.repeat(topics.CURRENT_POSE, lambda: pose, 10.0)
    rider.wait("ride", "eta_s", 75)
    rider.wait("place", "pose", [3.0, 0.0, 0.0])
    rider.wait("safety", "state", "DEGRADED")
    assert rider.state["safety"]["faults"][0]["code"] == "BATTERY_LOW"
    assert {item["id"] for item in rider.state["missions"]["list"]} >= {"site_ride", "wheelchair_transport"}
    assert rider.state["access"]["role"] == "rider"
    wait_for(lambda: len(screen.beats.items) >= 3, "three seconds")
    for name in {name for _, reported in rider.reported for name in reported}:  # only changes are sent
        values = [reported[name] for _, reported in rider.reported if name in reported]
        assert all(before != after for before, after in pairwise(values)), name
    robot.silence(topics.SAFETY_STATUS)
    rider.wait("stand", "reasons", ["NO_SAFETY"])


def _cloud() -> Any:
    points: Points = np.zeros(100, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
    return cloud_message(points, "base_link")


def test_heavy_data_come_only_while_a_page_shows_them(screen: TouchScreen, staff: WebPage, robot: Peer) -> None:
    pose, odom = PoseStamped(), Odometry()
    pose.pose.orientation.w = odom.pose.pose.orientation.w = 1.0
    grid = OccupancyGrid(data=[0] * 12)
    grid.info.width, grid.info.height, grid.info.resolution = 4, 3, 0.05
    grid.info.origin.orientation.w = 1.0
    image = Image(height=72, width=128, step=128, encoding="mono8", data=bytes(72 * 128))
    for row, message, rate_hz in (
        (topics.CURRENT_POSE, pose, 10.0),
        (topics.ODOM, odom, 20.0),
        (topics.LOCAL_COSTMAP, grid, 5.0),
        (topics.OBSTACLES, _cloud(), 20.0),
        (topics.FRONT_IMAGE, image, 10.0),
    ):
        robot.repeat(row, lambda message=message: message, rate_hz)

    def listeners(row: Any) -> int:
        return int(robot.publisher(row).get_subscription_count())

    heavy = {
        Layer.COSTMAP: topics.LOCAL_COSTMAP,
        Layer.OBSTACLES: topics.OBSTACLES,
        Layer.FRONT_IMAGE: topics.FRONT_IMAGE,
    }
    assert not any(listeners(row) for row in heavy.values())
    staff.say("show", layers=[layer.value for layer in heavy])
    for layer in heavy:
        number = frames.NUMBERS[layer]
        wait_for(lambda number=number: staff.frames.get(number), f"{layer.value}")
    counts = {number: len(items) for number, items in staff.frames.items()}
    staff.ask("call", on=False)  # a round trip: without "ready" no further frame is sent
    assert {number: len(items) for number, items in staff.frames.items()} == counts
    assert all(count == 1 for count in counts.values())
    staff.say("ready", layer="front_image")
    wait_for(lambda: len(staff.frames[frames.NUMBERS[Layer.FRONT_IMAGE]]) == 2, "the next image")
    assert staff.frames[frames.NUMBERS[Layer.FRONT_IMAGE]][-1][4:6] == b"\xff\xd8"  # a JPEG
    staff.say("show", layers=[])
    wait_for(lambda: not any(listeners(row) for row in heavy.values()), "no listeners")
    staff.say("show", layers=["costmap"])
    wait_for(lambda: listeners(topics.LOCAL_COSTMAP) == 1, "a listener again")


def test_diagnostics_history_and_recordings(screen: TouchScreen, staff: WebPage, robot: Peer) -> None:
    values = [KeyValue(key="input /odom", value="received=12 rate_hz=50.0 age_s=0.01 fresh=True")]
    status = DiagnosticStatus(name="navigation_controller", level=DiagnosticStatus.OK, message="well", values=values)
    robot.repeat(topics.DIAGNOSTICS, lambda: DiagnosticArray(status=[status]), 2.0)
    staff.say("show", layers=["diagnostics", "history", "recordings", "events"])

    def odom() -> bool:
        rows = staff.state.get("diagnostics", {}).get("topics", [])
        return any(row["name"] == "/odom" and row["state"] == "OK" and row["rate_hz"] == 50.0 for row in rows)

    wait_for(odom, "the rate of /odom")
    wait_for(lambda: any(item["what"] == "staff PIN" for item in staff.state["history"]["list"]), "the log-in")
    assert "list" in staff.state["recordings"]
    assert "list" in staff.state["events"]
    staff.say("logout")
    staff.wait("access", "role", "rider")
    assert staff.ask("show", layers=["history"])["why"] == "answer.needs_staff"


def test_operator_actions_are_on_record(start: Start, peer: Peer, tmp_path: Path) -> None:
    with web_page(TouchScreen(start, peer).port) as page:
        staff = page.log_in()
        staff.ask("start", mission="tour")
        staff.ask("goal", x=1.0, y=2.0, yaw=0.0)
        assert not staff.ask("login", pin="1111")["ok"]
        staff.say("stop")

        def lines() -> list[dict[str, str]]:
            logs = list((tmp_path / "state").rglob("touch_ui_audit.jsonl"))
            return [json.loads(text) for log in logs for text in log.read_text().splitlines()]

        wait_for(lambda: lines() and lines()[-1]["what"] == "emergency stop", "the record")
    assert [(item["what"], item["outcome"]) for item in lines()] == [
        ("staff PIN", "ok"),
        ("start mission tour", "ok"),
        ("goal 1.00 2.00 0.000", "ok"),
        ("staff PIN", "wrong"),
        ("emergency stop", "ok"),
    ]
    assert all("127.0.0.1" in item["who"] and item["at"].endswith("+00:00") for item in lines())
    assert "1111" not in json.dumps(lines())


# --- missions --------------------------------------------------------------------------------------------------------

TOUR = {
    "id": "tour",
    "name": {"en": "Tour", "ja": "一周", "zh": "一圈"},
    "home": {"x": 0, "y": 0, "yaw": 0},
    "waypoints": [{"name": "gate", "x": 1.0, "y": 2, "yaw": 0.5, "action": "park"}],
}


def saved(page: WebPage, **draft: Any) -> dict[str, Any]:
    return page.ask("mission_save", mission=TOUR | draft, was="", revision="")


def test_the_longest_mission_fits_and_only_from_staff(staff: WebPage, rider: WebPage) -> None:
    stops = [TOUR["waypoints"][0] | {"name": f"stop {number}"} for number in range(254)]
    assert saved(staff, waypoints=stops)["ok"]
    rider.say("mission_save", mission=TOUR | {"waypoints": stops}, was="", revision="")
    wait_for(lambda: any("longer than" in why for why in rider.refused), "the refusal")
    assert rider.ask("mission_save", mission=TOUR | {"id": "mine"}, was="", revision="")["why"] == "answer.needs_staff"
    assert rider.ask("mission_delete", mission="tour", revision="")["why"] == "answer.needs_staff"


def test_mission_that_cannot_be_saved_is_reported(staff: WebPage, shared_folder: Path) -> None:
    shutil.rmtree(shared_folder / "data", ignore_errors=True)
    (shared_folder / "data").write_text("no folder can be made here")
    answer = saved(staff)
    assert answer["why"] == "answer.mission_not_saved"
    assert "Not a directory" in answer["detail"]
    (shared_folder / "data").unlink()


# --- hostile ---------------------------------------------------------------------------------------------------------


def get(port: int, path: str, host: str | None = None, method: str = "GET") -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    try:
        connection.putrequest(method, path, skip_host=True)
        connection.putheader("Host", host or f"127.0.0.1:{port}")
        connection.endheaders()
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


PATHS = (
    "/../params.py",
    "/..%2fparams.py",
    "/%2e%2e/%2e%2e/params.py",
    "/....//params.py",
    "/static/../../nodes/hub.py",
    "//etc/passwd",
    "/%00index.html",
    "/index.html%00.js",
    "/..\\..\\params.py",
    "/web/index.html",
    "/vendor/",
    "/file:///etc/passwd",
    "/~root/.bashrc",
    "/" + "a" * 5000,
    "/?token=" + "x" * 100 + "&path=/etc/passwd",
)


def test_no_path_leads_out_of_the_page(screen: TouchScreen) -> None:
    for path in PATHS:
        status, body = get(screen.port, path)
        assert status in (200, 400, 404), path
        assert b"robot_stack" not in body, path
        assert b"root:" not in body, path
        if status == 200:
            assert body == get(screen.port, "/")[1], path


def test_foreign_pages_get_no_socket(screen: TouchScreen) -> None:
    for origin in (
        "http://evil.example",
        "null",
        f"http://127.0.0.1:{screen.port + 1}",
        f"https://127.0.0.1:{screen.port}",
    ):
        with pytest.raises(InvalidStatus) as refusal:
            WebPage(screen.port, origin=origin)
        assert refusal.value.response.status_code == 403
    assert get(screen.port, "/", host=f"evil.example:{screen.port}")[0] == 421
    assert get(screen.port, "/", method="POST")[0] == 405


def test_hostile_pages_change_nothing_and_crash_nothing(screen: TouchScreen) -> None:
    """2,000 malformed frames, from pages that reconnect after being closed."""
    draw = random.Random(11)
    harmless = [
        json.dumps(fields).encode()
        for fields, _ in GOOD
        if fields["t"] not in ("stop", "start", "pause", "resume", "abort")
    ]
    sent = 0
    while sent < 2000:
        page = WebPage(screen.port, alive=False)
        try:
            for _ in range(500):
                data = mutate(draw.choice(harmless), draw)
                page.send(data if draw.random() < 0.2 else data.decode("utf-8", "replace"))
                sent += 1
        except ConnectionClosed:
            pass
        wait_for(lambda page=page: page.closed is not None, "a page that is closed for what it said")
        page.close()
        assert page.closed in (1008, 1009), page.closed
    assert not any(arrived.items for arrived in screen.arrived)
    with web_page(screen.port) as page:
        assert page.ask("call", on=True)["ok"]
    assert screen.process.running()
    assert "Traceback" not in screen.process.output()


def test_a_flood_ends_with_the_page_and_others_go_on(screen: TouchScreen, rider: WebPage) -> None:
    page = WebPage(screen.port, alive=False)
    with suppress(ConnectionClosed):
        for _ in range(20_000):
            page.send('{"t": "pause"}')
    wait_for(lambda: page.closed == 1008, "the page to be closed")
    page.close()
    assert rider.ask("stop")["ok"]
    assert len(screen.commands.items) < 100


def test_too_many_pages(start: Start, peer: Peer) -> None:
    screen = TouchScreen(start, peer)
    pages = [WebPage(screen.port) for _ in range(8)]
    try:
        for page in pages:
            page.wait("access", "role", "rider")
        ninth = WebPage(screen.port, alive=False)
        wait_for(lambda: ninth.closed == 1013, "the ninth to be sent away")
        ninth.close()
        assert pages[0].ask("stop")["ok"]
    finally:
        for page in pages:
            page.close()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-p", "server.address:='0.0.0.0'"), "can be reached from outside"),
        (("-p", "server.address:='robot'"), "must be an IP address"),
        (("-p", "access.pin_hash:='2468'"), "access.pin_hash"),
        (("-p", "pages.map:='nowhere'"), "no map 'nowhere'"),
        (
            ("-p", "server.tls_certificate:=/nowhere.pem", "-p", "server.tls_key:=/nowhere.pem"),
            "tls_certificate or tls_key cannot be used",
        ),
    ],
)
def test_unsafe_server_configuration_is_rejected(start: Start, arguments: tuple[str, ...], said: str) -> None:
    process = start("touch_ui", *arguments)
    assert process.wait() == 2
    errors = [line for line in process.output().splitlines() if line.startswith("error:")]
    assert len(errors) == 1
    assert said in errors[0]


def test_touch_screen_url_is_available_while_served_at_a_port_that_is_free(start: Start, peer: Peer) -> None:
    screen = TouchScreen(start, peer)
    assert touch_screen_url() == f"http://127.0.0.1:{screen.port}/"
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(runtime_dir() / "other"))
        port = f"server.port:={screen.port}"
        second = start("touch_ui", "-p", port, "-p", "server.ports:=1", "-p", "pages.map:=''")
        assert second.wait() == 2
        third = start("touch_ui", "-p", port, "-p", "pages.map:=''")
    third.wait_output("serving http")  # the next free one
    assert f":{screen.port}/" not in third.output()
    assert "cannot be served" in second.output()
    screen.process.signal(signal.SIGTERM)
    assert screen.process.wait() == 0
    assert touch_screen_url() is None


def test_an_emergency_stop_of_others_is_shown(screen: TouchScreen, rider: WebPage, robot: Peer) -> None:
    robot.publish(topics.EMERGENCY_STOP, Bool(data=True))
    rider.wait("safety", "emergency", True)


def test_beyond_this_machine_only_with_the_token_over_tls(start: Start, peer: Peer, tmp_path: Path) -> None:
    """This test serves on the local machine like a robot serves others."""
    key, certificate, token = tmp_path / "key.pem", tmp_path / "certificate.pem", "t0ken-" * 6
    make = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=robot"
    names = ["-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run([*make.split(), *names], check=True, capture_output=True)
    tls = [f"server.tls_certificate:={certificate}", f"server.tls_key:={key}", f"server.token:={token}"]
    process = start(
        "touch_ui", "-p", "server.port:=0", "-p", "pages.map:=''", *(part for item in tls for part in ("-p", item))
    )
    process.wait_output("serving https://127.0.0.1:")
    port = int(process.output().split("serving https://127.0.0.1:")[1].split("/")[0])
    trust = ssl.create_default_context(cafile=str(certificate))

    def ask(path: str, **headers: str) -> http.client.HTTPResponse:
        connection = http.client.HTTPSConnection("127.0.0.1", port, context=trust, timeout=20)
        connection.request("GET", path, headers=headers)
        return connection.getresponse()

    assert [ask(path).status for path in ("/", "/texts.json", "/?token=", f"/?token={token[:-1]}x")] == [403] * 4
    welcome = ask(f"/?token={token}")
    assert (welcome.status, welcome.headers["location"]) == (303, "/")  # removes the token from the address bar
    cookie = welcome.headers["set-cookie"]
    assert all(part in cookie for part in ("HttpOnly", "Secure", "SameSite=strict"))
    sent = {"Cookie": cookie.partition(";")[0]}
    assert ask("/", **sent).status == 200
    assert ask("/", Cookie="touch_ui=" + "x" * 36).status == 403
    where, origin = f"wss://127.0.0.1:{port}/ws", Origin(f"https://127.0.0.1:{port}")
    with pytest.raises(InvalidStatus), connect(where, origin=origin, ssl=trust):
        pass
    with connect(where, origin=origin, ssl=trust, additional_headers=sent) as socket:
        assert json.loads(socket.recv(20.0))["t"] == "state"


def test_a_connection_that_becomes_nothing_is_ended_and_a_page_is_not(start: Start, peer: Peer) -> None:
    """Half a request, and a handshake that the server cannot parse and does not answer."""
    screen = TouchScreen(start, peer, "-p", "server.request_s:=1.0")
    with web_page(screen.port) as page:
        for begun in (
            b"GET / HTTP/1.1\r\nHost: ",
            b"",
            b"GET /ws HTTP/1.1\r\nHost: x\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nCookie: \x01\r\n\r\n",
        ):
            with socket.create_connection(("127.0.0.1", screen.port), 45.0) as connection:
                connection.sendall(begun)
                with suppress(ConnectionResetError):
                    assert connection.recv(100) == b""
        assert page.ask("pause")["ok"]
        assert page.closed is None
