"""What a fleet costs: processor time of links, broker and agents for 1000 robots, and how fast orders are accepted."""

from __future__ import annotations

import resource
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from paho.mqtt.client import Client

from robot_stack.cli.errors import CommandError
from robot_stack.cli.fleet_site import Files, Site, mosquitto
from robot_stack.fleet.link import Connected, Topic
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.mqtt_client import connect, mqtt_client
from robot_stack.fleet.nodes.mqtt_link import MqttLink
from tests.benchmarks.support.fleet_many import Manager
from tests.benchmarks.support.fleet_many import robots as robots_running
from tests.benchmarks.support.fleet_yard import transports_per_robot_h
from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile

_STATE = b'{"information": "' + 1981 * b"x" + b'"}'  # 2 kB
_PERIOD_S = 1.0
_DEADLINE_S = 30.0
_DESCRIPTORS = 4096
_PREFIX = "uagv/v2/bench"
_YARD_SIZE = 14
_YARD_ROBOTS = (1, 10, 50)

AIMS = {
    "agent_states_per_s": Aim(">=", 1000.0),
    "orders_per_s": Aim(">=", 50.0),
    "orders_accepted_p50_ms": Aim("<", 200.0),
    "orders_accepted_p99_ms": Aim("<", 200.0),
    "orders_lost": Aim("<=", 0),
    "states_lost": Aim("<=", 0),
}


def run(
    duration_s: float = 20.0,
    port: int = 18883,
    few: int = 100,
    many: int = 1000,
    robots: int = 1000,
    processes: int = 8,
    orders_per_s: float = 52.0,
    yard_s: float = 1800.0,
    journals: str = "/dev/shm",
    idle_every: int = 2,
) -> Result:
    """Every robot has a TLS connection with its own certificate and sends a state of 2 kB each second.

    link_cpu_pct: of one core, the process with one link. broker_cpu_pct_few, broker_cpu_pct_many, broker_mb_many: with
    one fleet manager that receives all states. states_per_s_few, states_per_s_many: fewer than robots if this computer
    is too slow to send them. states_lost: between robots and manager.

    Then ``robots`` robots with the kernels and journals of the real one and a kinematic body, in ``processes``
    processes, 0 for none: agent_*, orders_*, broker_cpu_pct_agents. agent_cpu_pct and agent_mb are of one robot, with
    its mission manager. Each robot reads its messages 10 times a second (agent_reads_per_s), and calls its kernels for
    one, otherwise each ``idle_every`` times. journals: folder, by default in memory, because robots do not share a
    disk. orders_late: for robots that were not ready in their turn. yard_*: transports for each robot and hour by the
    example dispatcher, with 1, 10 and 50 robots on one yard, in ``yard_s`` of simulated time, 0 for none.
    """
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(_DESCRIPTORS, hard), hard))
    with tempfile.TemporaryDirectory() as folder, _broker(Site(Path(folder) / "site"), port) as (site, broker):
        figures = {"link_cpu_pct": _link_pct(site, duration_s)}
        lost = 0
        for name, count in (("few", few), ("many", many)):
            broker_pct, rate_hz, missing = _broker_load(site, broker, count, duration_s)
            figures |= {f"broker_cpu_pct_{name}": broker_pct, f"states_per_s_{name}": rate_hz}
            lost += missing
        figures["broker_mb_many"] = broker.memory_info().rss / 1e6
        if robots:
            figures |= _agents(site, broker, robots, processes, duration_s, orders_per_s, journals, idle_every)
    figures["states_lost"] = float(lost)
    for count in _YARD_ROBOTS if yard_s else ():
        figures[f"yard_transports_per_robot_h_{count}"] = transports_per_robot_h(_YARD_SIZE, count, yard_s)
    return Result(figures, {"few": few, "many": many, "state_bytes": len(_STATE)})


def _agents(
    site: Site,
    broker: psutil.Process,
    count: int,
    processes: int,
    duration_s: float,
    orders_per_s: float,
    journals: str,
    idle_every: int,
) -> dict[str, float]:
    """First with states alone, then with orders to all robots in turn."""
    serials = [f"agent-{number}" for number in range(count)]
    params = {serial: _params(site.robot_url(), site.add_robot(serial)) for serial in serials}
    manager = Manager(_params(site.master_url(), site.master()), serials)
    try:
        with (
            tempfile.TemporaryDirectory(dir=journals) as folder,
            robots_running(params, Path(folder), processes, idle_every) as shares,
        ):
            before, states = broker.cpu_times(), manager.states
            manager.run(duration_s, 0.0)
            after, states = broker.cpu_times(), manager.states - states
            begun_s = time.monotonic()
            manager.run(duration_s, orders_per_s)
            rate_hz = manager.sent / (time.monotonic() - begun_s)
            manager.wait(_DEADLINE_S)
    finally:
        manager.close()
    used_s = after.user + after.system - before.user - before.system
    robot_s = sum(share.robots * share.duration_s for share in shares)
    return {
        "agent_states_per_s": states / duration_s,
        "agent_reads_per_s": sum(share.reads for share in shares) / robot_s,
        "agent_cpu_pct": 100.0 * sum(share.cpu_s for share in shares) / robot_s,
        "agent_mb": sum(share.memory_mb for share in shares) / count,
        "broker_cpu_pct_agents": 100.0 * used_s / duration_s,
        "orders_per_s": rate_hz,
        "orders_late": float(manager.late),
        "orders_accepted_p50_ms": 1e3 * percentile(manager.accepted_s, 0.5),
        "orders_accepted_p99_ms": 1e3 * percentile(manager.accepted_s, 0.99),
        "orders_lost": float(manager.lost),
    }


@contextmanager
def _broker(site: Site, port: int) -> Iterator[tuple[Site, psutil.Process]]:
    try:
        program = mosquitto()
    except CommandError as error:
        raise BenchError(str(error)) from None
    file = site.prepare(port, local=False, names=["localhost"])
    process = subprocess.Popen([program, "-c", str(file)], stderr=subprocess.DEVNULL)
    try:
        yield site, psutil.Process(process.pid)
    finally:
        process.terminate()
        process.wait()


def _link_pct(site: Site, duration_s: float) -> float:
    files = site.add_robot("link")
    link = MqttLink(
        _params(site.robot_url(), files), "link", f"{_PREFIX}/link", lambda: b"{}", lambda: b"{}", lambda: b"{}"
    )
    try:
        end_s = time.monotonic() + _DEADLINE_S
        while Connected(session_present=False) not in link.receive():
            if time.monotonic() > end_s:
                raise BenchError(f"the link does not connect: {link.state}")
            time.sleep(0.05)
        before_s = _own_cpu_s()
        for _ in _seconds(duration_s):
            link.send(Topic.STATE, _STATE)
        return 100.0 * (_own_cpu_s() - before_s) / duration_s
    finally:
        link.close()


def _broker_load(site: Site, broker: psutil.Process, count: int, duration_s: float) -> tuple[float, float, int]:
    """Share of one core, rate of states, and number of states that did not reach the fleet manager."""
    received: list[str] = []
    manager = mqtt_client(
        _params(site.master_url(), site.master()), "manager", persistent=False, on_error=lambda _: None
    )
    manager.on_message = lambda _client, _data, message: received.append(message.topic)
    connect(manager, _params(site.master_url(), site.master()), persistent=False)
    manager.subscribe("+/+/+/+/state")
    manager.loop_start()
    robots = [_robot(site, f"robot-{count}-{number}") for number in range(count)]
    try:
        before, sent, began_s = broker.cpu_times(), 0, time.monotonic()
        for _ in _seconds(duration_s):
            # Spread over the second, as independent robots are.
            for number, (serial, client) in enumerate(robots):
                client.publish(f"{_PREFIX}/{serial}/state", _STATE)
                sent += 1
                if number % 20 == 19:
                    time.sleep(0.5 * _PERIOD_S * 20 / count)
        after, elapsed_s = broker.cpu_times(), time.monotonic() - began_s
        end_s = time.monotonic() + _DEADLINE_S
        while len(received) < sent and time.monotonic() < end_s:
            time.sleep(0.1)
    finally:
        for _, client in robots:
            client.disconnect()
        manager.disconnect()
        manager.loop_stop()
    used_s = after.user + after.system - before.user - before.system
    return 100.0 * used_s / elapsed_s, sent / elapsed_s, sent - len(received)


def _robot(site: Site, serial: str) -> tuple[str, Client]:
    params = _params(site.robot_url(), site.add_robot(serial))
    client = mqtt_client(params, serial, persistent=False, on_error=lambda _: None)
    connect(client, params, persistent=False)
    end_s = time.monotonic() + _DEADLINE_S
    while not client.is_connected():
        client.loop_read()
        if time.monotonic() > end_s:
            raise BenchError(f"{serial} does not connect")
    return serial, client


def _params(url: str, files: Files) -> BrokerParams:
    return BrokerParams(
        url=url,
        ca_file=str(files.ca),
        certificate_file=str(files.certificate),
        key_file=str(files.key),
        keep_alive_s=600,
        timeout_s=30.0,
    )


def _seconds(duration_s: float) -> Iterator[None]:
    """Once each period, late if the caller is."""
    next_s = time.monotonic()
    for _ in range(round(duration_s / _PERIOD_S)):
        yield
        next_s += _PERIOD_S
        time.sleep(max(0.0, next_s - time.monotonic()))


def _own_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
