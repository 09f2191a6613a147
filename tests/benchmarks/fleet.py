"""What a fleet's connections cost: processor time of a robot's link, and of the broker for 100 and 1000 robots."""

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
from tests.benchmarks.support.framework import BenchError, Result

_STATE = b'{"information": "' + 1981 * b"x" + b'"}'  # 2 kB
_PERIOD_S = 1.0
_DEADLINE_S = 30.0
_DESCRIPTORS = 4096
_PREFIX = "uagv/v2/bench"


def run(duration_s: float = 20.0, port: int = 18883, few: int = 100, many: int = 1000) -> Result:
    """Every robot has a TLS connection with its own certificate and sends a state of 2 kB each second.

    link_cpu_pct: of one core, the process with one link. broker_cpu_pct_few, broker_cpu_pct_many, broker_mb_many: with
    one fleet manager that receives all states. states_per_s_few, states_per_s_many: fewer than robots if this computer
    is too slow to send them. states_lost: between robots and manager.
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
    figures["states_lost"] = float(lost)
    return Result(figures, {"few": few, "many": many, "state_bytes": len(_STATE)})


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
