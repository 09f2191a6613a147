"""The commands of ``robot-stack fleet`` with a real broker and a robot by another implementation."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.cli.fleet_site import Site
from tests.support.fleet.broker import Peer, RunningBroker, free_ports, require_mosquitto, running_broker
from tests.support.fleet.foreign_robot import MAKER, ForeignRobot
from tests.support.fleet.orders import order
from tests.support.processes import ROOT
from tests.support.waiting import wait_for


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[RunningBroker]:
    with running_broker(tmp_path / "site", local=True) as running:
        yield running


def run(broker: RunningBroker | None, *arguments: str, folder: Path | None = None) -> Result:
    place = folder or (broker.site.folder if broker else Path("/nonexistent"))
    return CliRunner().invoke(app, ["fleet", *arguments, "--folder", str(place)])


def written(folder: Path, data: Any) -> str:
    file = folder / "message.json"
    file.write_text(data if isinstance(data, str) else json.dumps(data), encoding="utf-8")
    return str(file)


def test_order_is_followed_to_its_end(broker: RunningBroker, tmp_path: Path) -> None:
    with closing(ForeignRobot(broker.site.robot_url(), "F1", state_interval_s=1000.0)) as robot:
        asked = run(broker, "status", "--wait", "60")
        assert asked.exit_code == 0
        assert "1.00, 2.00 yard" in asked.output, "a state is asked for"
        result = run(broker, "send", written(tmp_path, order("o-1", ["start", "a", "b"], serialNumber="F1")))
        assert result.exit_code == 0, result.exception
        assert result.output.splitlines()[-1] == "F1: order o-1 is finished"
        assert robot.orders == ["o-1"]
        shown = run(broker, "status")
        assert shown.exit_code == 0
        for part in ("F1", "ONLINE", "o-1", "3.00, 2.00 yard"):  # it has arrived at the last node
            assert part in shown.output
        data = json.loads(run(broker, "status", "--json").output)
        assert data[f"uagv/v2/{MAKER}/F1"]["state"]["lastNodeId"] == "b"


def test_each_sending_of_an_order_without_an_id_is_another_order(broker: RunningBroker, tmp_path: Path) -> None:
    data = order("", ["start", "a"], serialNumber="F1")
    del data["orderId"], data["orderUpdateId"]
    with closing(ForeignRobot(broker.site.robot_url(), "F1")) as robot:
        for _ in range(2):
            result = run(broker, "send", written(tmp_path, data))
            assert result.exit_code == 0, result.exception
            data["nodes"][0]["nodePosition"] |= {"allowedDeviationXY": 5.0}
        assert len(set(robot.orders)) == 2
        assert all(name.startswith("message-") for name in robot.orders)


def test_order_shows_its_progress_and_is_cancelled(broker: RunningBroker, tmp_path: Path) -> None:
    with closing(ForeignRobot(broker.site.robot_url(), "F1", waits=True)) as robot:
        file = written(tmp_path, order("o-1", ["start", "a", "b"], serialNumber="F1"))
        sending = subprocess.Popen(
            _command(broker, "send", file), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        wait_for(lambda: robot.orders, "the order")
        robot.release()
        wait_for(lambda: robot.client.publisher.last_node_id == "a", "the first node")
        cancelled = run(broker, "cancel", "F1")
        assert cancelled.exit_code == 0, cancelled.exception
        assert "cancelOrder FINISHED" in cancelled.output
        shown, problem = sending.communicate(timeout=120.0)
        assert sending.returncode == 1
        assert "last node a" in shown
        assert "order o-1 failed: ended at node a" in problem
        again = run(broker, "cancel", f"{MAKER}/F1")
        assert again.exit_code == 1
        assert "cancelOrder FAILED" in str(again.exception)


def _command(broker: RunningBroker, *arguments: str) -> list[str]:
    """Of another process."""
    return [sys.executable, "-m", "robot_stack.cli", "fleet", *arguments, "--folder", str(broker.site.folder)]


@contextmanager
def started(command: list[str], **output: Any) -> Iterator[subprocess.Popen[str]]:
    """A command that runs until it is interrupted, and then ends well."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "100"}
    process = subprocess.Popen(command, cwd=ROOT, env=environment, text=True, **output)
    try:
        yield process
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.wait()


def test_watch_follows_until_interrupted(broker: RunningBroker) -> None:
    terminal, end = pty.openpty()
    shown = ""
    try:
        with started(_command(broker, "watch"), stdout=end, stderr=end):
            with closing(ForeignRobot(broker.site.robot_url(), "F1")):
                while "ONLINE" not in shown:  # ended by the time limit of a test
                    shown += os.read(terminal, 4096).decode(errors="replace")
            while "OFFLINE" not in shown:
                shown += os.read(terminal, 4096).decode(errors="replace")
    finally:
        os.close(terminal)
        os.close(end)


def test_refused_order_fails_with_the_robot_s_reason(broker: RunningBroker, tmp_path: Path) -> None:
    with closing(ForeignRobot(broker.site.robot_url(), "F1")) as robot:
        far = order("o-1", ["elsewhere", "a"], serialNumber="F1")
        far["nodes"][0]["nodePosition"]["x"] = 500.0
        result = run(broker, "send", written(tmp_path, far))
        assert result.exit_code == 1
        assert "orderError" in str(result.exception)
        assert robot.orders == []


def test_instant_actions_and_return_after_acceptance(broker: RunningBroker, tmp_path: Path) -> None:
    def actions(kind: str, action_id: str) -> str:
        action = {"actionType": kind, "actionId": action_id, "blockingType": "NONE", "actionParameters": []}
        return written(tmp_path, {"actions": [action]})

    with closing(ForeignRobot(broker.site.robot_url(), "F1", waits=True)):
        assert run(broker, "send", actions("startPause", "p-1"), "--robot", "F1").exit_code == 0
        failed = run(broker, "send", actions("dance", "d-1"), "--robot", "F1")
        assert failed.exit_code == 1
        assert "dance FAILED" in str(failed.exception)
        file = written(tmp_path, order("o-1", ["start", "a"], serialNumber="F1"))
        accepted = run(broker, "send", file, "--no-wait")
        assert accepted.exit_code == 0
        assert accepted.output.splitlines()[-1] == "F1: order o-1 is accepted"


def test_robot_that_is_lost_or_silent(broker: RunningBroker, tmp_path: Path) -> None:
    robot = ForeignRobot(broker.site.robot_url(), "F1")
    watcher = Peer(broker.params(), "watcher").connected().subscribe("+/+/+/+/connection")
    robot.lose()
    wait_for(lambda: any("CONNECTIONBROKEN" in payload for _, payload, _ in watcher.received), "last will")
    watcher.close()
    shown = run(broker, "status", "--wait", "0.5")
    assert shown.exit_code == 1
    assert "CONNECTIONBROKEN" in shown.output
    file = written(tmp_path, order("o-1", ["start", "a"], serialNumber="F1"))
    result = run(broker, "send", file, "--accept", "0.5", "--wait", "0.5")
    assert result.exit_code == 1
    assert "F1 is CONNECTIONBROKEN" in result.output
    assert "has not accepted order o-1 within 0.5 s" in str(result.exception)


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        ("{", "is not valid JSON"),
        ("[]", "must be an order with nodes, or instant actions"),
        ({"nodes": [], "actions": []}, "must be an order with nodes, or instant actions"),
        ({"nodes": [], "edges": []}, "no serialNumber"),
        (order("o-1", ["start"], serialNumber="F1", manufacturer="else"), "manufacturer is 'else'"),
        (order("o-1", ["start"], serialNumber="F1", version="3.0.0"), "version 3.0.0"),
        (order("o-1", ["start"], released=0, serialNumber="F1"), "releases no node"),
        ({**order("o-1", ["start"], serialNumber="F1"), "orderUpdateId": "first"}, "orderUpdateId"),
    ],
)
def test_wrong_files_are_not_sent(broker: RunningBroker, tmp_path: Path, data: Any, problem: str) -> None:
    robot = Peer(broker.params(), "robot").connected().subscribe(f"uagv/v2/{MAKER}/F1/#")
    robot.publish(f"uagv/v2/{MAKER}/F1/connection", '{"connectionState": "ONLINE"}', retain=True)
    result = run(broker, "send", written(tmp_path, data))
    robot.publish(f"uagv/v2/{MAKER}/F1/state", "{}")
    wait_for(lambda: robot.payloads(f"uagv/v2/{MAKER}/F1/state"), "a later message")
    robot.close()
    assert problem in str(result.exception)
    assert getattr(result.exception, "code", None) == 2
    assert robot.payloads(f"uagv/v2/{MAKER}/F1/order") == []


def test_a_robot_of_3_0_gets_what_3_0_has(broker: RunningBroker, tmp_path: Path) -> None:
    prefix = f"uagv/v3/{MAKER}/G1"
    robot = Peer(broker.params(), "robot of 3.0").connected().subscribe(f"{prefix}/#")
    before = prefix.replace("v3", "v2")
    robot.publish(f"{before}/connection", '{"connectionState": "OFFLINE", "version": "2.1.0"}', retain=True)
    robot.publish(f"{prefix}/connection", '{"connectionState": "ONLINE", "version": "3.0.0"}', retain=True)
    old = order("o-1", ["start", "a"], serialNumber="G1")
    data = old | {"edges": [{k: v for k, v in edge.items() if not k.endswith("NodeId")} for edge in old["edges"]]}
    for node in data["nodes"]:
        node["nodePosition"]["allowedDeviationXY"] = {"a": 1.0, "b": 0.5, "theta": 0.0}
    result = run(broker, "send", written(tmp_path, data), "--accept", "0.5")
    assert "has not accepted order o-1" in str(result.exception)
    wait_for(lambda: robot.payloads(f"{prefix}/order"), "the order")
    assert json.loads(robot.payloads(f"{prefix}/order")[0])["version"] == "3.0.0"
    data["nodes"][0]["nodePosition"]["allowedDeviationXY"] = 1.0
    wrong = run(broker, "send", written(tmp_path, data))
    assert "allowedDeviationXY" in str(wrong.exception)
    assert "the robot's is 3.0.0" in str(run(broker, "send", written(tmp_path, data | {"version": "2.1.0"})).exception)
    robot.close()


def test_unknown_robot_and_garbage_of_others(broker: RunningBroker, tmp_path: Path) -> None:
    peer = Peer(broker.params(), "peer").connected()
    for topic, payload in (
        ("connection", '{"connectionState": "ONLINE"}'),
        ("state", '{"nodeStates": 3, "agvPosition": {"x": "\\u001b[2J"}, "errors": [1, {"errorType": null}]}'),
        ("factsheet", "no JSON"),
        ("visualization", "[" * 50_000),
    ):
        peer.publish(f"uagv/v2/{MAKER}/K1/{topic}", payload, retain=True)
    peer.publish(f"uagv/v2/{MAKER}/K2/connection", '{"connectionState": "ONLINE"}', retain=True)
    peer.publish(f"uagv/v2/{MAKER}/K2/state", '{"orderId": ' + "[" * 100 + "]" * 100 + "}", retain=True)
    peer.close()
    shown = run(broker, "status", "--wait", "0.5")
    assert shown.exit_code == 0, shown.exception
    assert "K1" in shown.output
    assert "\x1b[2J" not in shown.output
    assert "no state yet" in shown.output, "K2: it is nested too deep"
    file = written(tmp_path, order("o-1", ["start", "a"], serialNumber="F9"))
    result = run(broker, "send", file, "--wait", "0.5")
    assert "knows no robot 'F9'; robots that have connected: K1, K2" in str(result.exception)


def test_no_broker(tmp_path: Path) -> None:
    require_mosquitto()
    assert "fleet up" in str(run(None, "status").exception)
    with running_broker(tmp_path / "site", local=True) as broker:
        broker.kill()
        assert "no connection to the broker mqtt://127.0.0.1" in str(run(broker, "status").exception)
    result = run(broker, "status", "--broker", "mqtt://elsewhere.example")
    assert "use mqtts://" in str(result.exception)


def test_certificates_of_the_manager(tmp_path: Path) -> None:
    with running_broker(tmp_path / "site") as broker:
        site = broker.site
        assert run(broker, "status", "--wait", "0.1").exit_code == 0
        added = run(broker, "add-robot", "A1")
        assert added.exit_code == 0, added.exception
        assert f"robot-stack up --profile robot --fleet mqtts://localhost:{broker.port}" in added.output
        assert "broker.key_file=/etc/robot_stack/fleet/client.key" in added.output
        key = site.robot("A1").key.read_bytes()
        assert "valid until it expires" in run(broker, "rotate", "A1").output
        assert "rejected once the broker restarts" in run(broker, "rotate", "A1", "--revoke").output
        assert site.robot("A1").key.read_bytes() != key
        of_robot = run(broker, "status", "--certificates", str(site.robot("A1").key.parent))
        assert "does not accept" in str(of_robot.exception)
        assert "there is no" in str(run(broker, "status", "--certificates", str(tmp_path)).exception)
        stranger = Site(tmp_path / "stranger")
        stranger.prepare(1, local=False, names=["localhost"])
        other = run(None, "status", "--broker", site.master_url(), folder=stranger.folder)
        assert "the broker's certificate is not trusted" in str(other.exception)


@pytest.mark.parametrize("local", [True, False])
def test_up_runs_until_interrupted(tmp_path: Path, local: bool) -> None:
    require_mosquitto()
    port, folder = free_ports(), tmp_path / "site"
    command = [sys.executable, "-m", "robot_stack.cli", "fleet", "up", "--port", str(port), "--folder", str(folder)]
    command += ["--local"] if local else ["--name", "localhost"]
    with started(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        scheme = "mqtt://127.0.0.1" if local else "mqtts://localhost"
        assert process.stdout.readline() == f"robots: {scheme}:{port}\n"
        wait_for(lambda: run(None, "status", "--wait", "0.1", folder=folder).exit_code == 0, "the broker")


def test_page_is_served_until_interrupted(broker: RunningBroker) -> None:
    with started(_command(broker, "page", "--port", "0"), stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        url = process.stdout.readline().removeprefix("fleet page: ").strip()
        assert url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(url, timeout=60.0) as answer:
            assert b"/fleet.js" in answer.read()
    assert "no map 'nowhere'" in str(run(broker, "page", "--map", "nowhere").exception)
    assert "without --local" in str(run(broker, "page", "--bind", "127.0.0.1").exception)
