"""fleet up, add-robot, rotate, status, watch, page, send, cancel: a broker for robots and a small fleet manager."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from robot_stack.cli.errors import WRONG_USE, CommandError

if TYPE_CHECKING:
    from rich.table import Table

    from robot_stack.cli.fleet_broker import Fleet
    from robot_stack.cli.fleet_robots import Progress, Robot
    from robot_stack.cli.fleet_site import Files, Site
    from robot_stack.fleet.link import Topic

fleet = typer.Typer(help="A fleet of robots over MQTT: broker, certificates, orders.", no_args_is_help=True)

_WAIT_S: Final = 3.0
_REFRESH_S: Final = 0.5

Folder = Annotated[
    Path | None,
    typer.Option(
        "--folder", help="Folder of the broker on this computer, by default ~/.local/share/robot_stack/fleet."
    ),
]
Broker = Annotated[
    str | None, typer.Option("--broker", metavar="URL", help="mqtts://HOST:PORT; by default the broker of `fleet up`.")
]
Certificates = Annotated[
    Path | None,
    typer.Option("--certificates", help="Folder with ca.crt, client.crt and client.key of a fleet manager."),
]
Serial = Annotated[str, typer.Argument(metavar="SERIAL", help="Serial number of the robot.")]
Wait = Annotated[float, typer.Option("--wait", min=0.1, help="Seconds to wait for messages of the robots.")]
Acceptance = Annotated[float, typer.Option("--accept", min=0.1, help="Seconds within which the robot must accept it.")]


@fleet.command()
def up(
    port: Annotated[int, typer.Option(min=1, max=65534, help="Of robots; fleet managers use the next one.")] = 8883,
    local: Annotated[
        bool, typer.Option("--local", help="Without certificates, for this computer alone: to try things out.")
    ] = False,
    names: Annotated[
        list[str] | None,
        typer.Option("--name", help="Host name or address under which robots reach the broker; may be repeated."),
    ] = None,
    folder: Folder = None,
) -> None:
    """Run the broker (mosquitto) in the foreground until Ctrl-C."""
    from robot_stack.cli.fleet_site import mosquitto

    program, site = mosquitto(), _site(folder)
    file = site.prepare(port, local=local, names=names or ())
    print(f"robots: {site.robot_url()}")
    print(f"fleet managers: {site.master_url()}" + ("" if local else f" with {site.master().certificate.parent}"))
    if not local:
        print("a robot: `robot-stack fleet add-robot SERIAL`")
    print(f"files: {site.folder}", flush=True)
    os.execv(program, [program, "-c", str(file)])


@fleet.command("add-robot")
def add_robot(serial: Serial, folder: Folder = None) -> None:
    """Issue certificate and key of a robot, and print its commands."""
    site = _site(folder)
    files = site.add_robot(serial)
    print(f"{serial}: {files.certificate.parent}")
    _print_commands(site, serial, files)


@fleet.command()
def rotate(
    serial: Serial,
    revoke: Annotated[
        bool, typer.Option("--revoke", help="Reject the old certificate from the next start of the broker on.")
    ] = False,
    folder: Folder = None,
) -> None:
    """Replace certificate and key of a robot, which reconnects with them once they are copied to it."""
    site = _site(folder)
    if revoke:
        site.revoke(serial)
    files = site.add_robot(serial, again=True)
    print(f"{serial}: new certificate in {files.certificate.parent}; copy its files to the robot")
    print("the old one is rejected once the broker restarts" if revoke else "the old one is valid until it expires")


@fleet.command()
def status(
    as_json: Annotated[bool, typer.Option("--json", help="Print the last messages of each robot as JSON.")] = False,
    wait_s: Wait = _WAIT_S,
    broker: Broker = None,
    certificates: Certificates = None,
    folder: Folder = None,
) -> None:
    """Show the robots: connection, order, position, battery, errors. Exit code 1 if one is not online.

    Robots that are online are asked for their state, which the broker does not keep.
    """
    from robot_stack.cli.tables import console

    with _connected(broker, certificates, folder) as connected:
        for robot, topic in connected.updates(wait_s):
            _request_state(connected, robot, topic)
            if connected.robots and all("state" in robot.messages for robot in connected.robots.values()):
                # The broker sends retained messages first: all robots are known.
                break
        robots = list(connected.robots.values())
    if as_json:
        print(json.dumps({robot.prefix: robot.messages for robot in robots}, indent=2))
    else:
        console().print(_table(robots))
    if any(robot.connection != "ONLINE" for robot in robots):
        raise typer.Exit(1)


@fleet.command()
def watch(broker: Broker = None, certificates: Certificates = None, folder: Folder = None) -> None:
    """Follow the table of `fleet status` until Ctrl-C."""
    from rich.live import Live

    from robot_stack.cli.tables import console

    with (
        _connected(broker, certificates, folder) as connected,
        Live(_table([]), console=console(), auto_refresh=False) as live,
        _interrupts() as interrupts,
    ):
        while not interrupts:
            for robot, topic in connected.updates(_REFRESH_S):
                _request_state(connected, robot, topic)
            live.update(_table(connected.robots.values()), refresh=True)


@fleet.command()
def page(
    port: Annotated[int, typer.Option(min=0, max=65_535, help="Of the page; 0 for any free one.")] = 8470,
    bind: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="This computer's address, or 0.0.0.0: for phones and other computers, with the broker's certificate. "
            "Orders are then cancelled with the PIN of config/touch_ui.yaml.",
        ),
    ] = None,
    map_name: Annotated[
        str | None,
        typer.Option("--map", help="Of config/maps or a folder, by default the touch screen's; empty for none."),
    ] = None,
    broker: Broker = None,
    certificates: Certificates = None,
    folder: Folder = None,
) -> None:
    """Serve a page with map, robots and orders until Ctrl-C."""
    from robot_stack.cli.fleet_broker import broker_params
    from robot_stack.cli.fleet_page import FleetPage
    from robot_stack.core.config import load
    from robot_stack.ui.params import TouchUiParams

    site = _site(folder)
    params, screen = broker_params(site, broker, certificates), load(TouchUiParams, "touch_ui")
    served = FleetPage(params, site, screen, port, bind, map_name)
    with _interrupts() as interrupts:
        print(f"fleet page: {served.url}", flush=True)
        served.run(lambda: bool(interrupts), _request_state, lambda robot: _instant_action("cancelOrder", robot))


@contextlib.contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Collects Ctrl-C instead of raising KeyboardInterrupt, which would end the drawing of a table in its middle."""
    found: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: found.append(number))
    try:
        yield found
    finally:
        signal.signal(signal.SIGINT, before)


@fleet.command()
def send(
    file: Annotated[Path, typer.Argument(help="An order or instant actions in JSON.")],
    robot: Annotated[str | None, typer.Option("--robot", help="Serial number, if the file names no robot.")] = None,
    no_wait: Annotated[bool, typer.Option("--no-wait", help="Return once it is accepted.")] = False,
    accept_s: Acceptance = 10.0,
    wait_s: Wait = _WAIT_S,
    broker: Broker = None,
    certificates: Certificates = None,
    folder: Folder = None,
) -> None:
    """Check a file against the schema of VDA 5050, send it, and follow it to its end.

    Missing headerId, timestamp, version, manufacturer and serialNumber are filled in, and for an order without an
    orderId a new one. Exit code 1 if the robot refuses it or does not finish it, 2 if the file is wrong.
    """
    data = _read(file)
    name = robot or data.get("serialNumber")
    if not isinstance(name, str) or not name:
        raise CommandError(f"{file}: has no serialNumber: name the robot with --robot", WRONG_USE)
    with _connected(broker, certificates, folder) as connected:
        found = connected.find(name, wait_s)
        _follow(connected, found, _completed(data, found, str(file)), accept_s, no_wait)


@fleet.command()
def cancel(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="Serial number, or MANUFACTURER/SERIAL.")],
    accept_s: Acceptance = 10.0,
    wait_s: Wait = _WAIT_S,
    broker: Broker = None,
    certificates: Certificates = None,
    folder: Folder = None,
) -> None:
    """Cancel the order of a robot and wait until it has stopped."""
    with _connected(broker, certificates, folder) as connected:
        found = connected.find(robot, wait_s)
        _follow(connected, found, _instant_action("cancelOrder", found), accept_s, no_wait=False)


def _instant_action(kind: str, robot: Robot) -> dict[str, Any]:
    action = {"actionType": kind, "actionId": f"{kind}-{secrets.token_hex(8)}", "blockingType": "NONE"}
    return _completed({"actions": [action]}, robot, kind)


def _request_state(connected: Fleet, robot: Robot, topic: Topic) -> None:
    """Of a robot that is online, with the first message about it; the state arrives later."""
    if topic == "connection" and robot.connection == "ONLINE" and "state" not in robot.messages:
        with contextlib.suppress(CommandError):  # of a version that this command does not write
            connected.send(robot, topic.INSTANT_ACTIONS, _instant_action("stateRequest", robot))


def _follow(connected: Fleet, robot: Robot, data: dict[str, Any], accept_s: float, no_wait: bool) -> None:
    from robot_stack.cli.fleet_robots import Outcome, actions_progress, errors_of, order_progress
    from robot_stack.fleet.link import Topic

    is_order = "nodes" in data
    progress_of: Callable[..., Progress] = order_progress if is_order else actions_progress
    what = f"order {data['orderId']}" if is_order else "instant actions"
    if robot.connection != "ONLINE":
        print(f"{robot.serial} is {robot.connection}: it receives this when it connects", flush=True)
    before = errors_of(robot.messages.get(Topic.STATE, {}))
    connected.send(robot, Topic.ORDER if is_order else Topic.INSTANT_ACTIONS, data)
    end_s, accepted, shown = time.monotonic() + accept_s, False, ""
    while True:
        left_s = None if accepted else end_s - time.monotonic()
        update = next(connected.updates(left_s), None)
        if update is None:
            raise CommandError(f"{robot.serial} has not accepted {what} within {accept_s:g} s: {shown or 'no state'}")
        changed, topic = update
        if changed is not robot or topic not in (Topic.STATE, Topic.CONNECTION):
            continue
        if topic is Topic.CONNECTION:
            print(f"{robot.serial} is {robot.connection}", flush=True)
            continue
        progress = progress_of(data, robot.messages[topic], before)
        accepted = accepted or progress.accepted
        if progress.words != shown:
            shown = progress.words
            print(f"{robot.serial}: {what}: {shown}", flush=True)
        if progress.outcome is Outcome.FAILED:
            raise CommandError(f"{robot.serial}: {what} failed: {progress.words}")
        if progress.outcome is Outcome.FINISHED or (no_wait and accepted):
            print(f"{robot.serial}: {what} is {'accepted' if no_wait else 'finished'}")
            return


def _read(file: Path) -> dict[str, Any]:
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise CommandError(f"{file}: cannot be read: {error.strerror}", WRONG_USE) from None
    except (ValueError, RecursionError) as error:
        raise CommandError(f"{file}: is not valid JSON: {error}", WRONG_USE) from None
    if not isinstance(data, dict) or ("nodes" in data) == ("actions" in data):
        raise CommandError(f"{file}: must be an order with nodes, or instant actions with actions", WRONG_USE)
    return data


def _completed(data: dict[str, Any], robot: Robot, source: str) -> dict[str, Any]:
    """With a header for the robot, checked against the schema. Raises CommandError with what is wrong."""
    from robot_stack.cli.fleet_site import LONGEST_PACKET_BYTES
    from robot_stack.fleet.codec import decode, timestamp
    from robot_stack.fleet.errors import Refused
    from robot_stack.fleet.link import Topic
    from robot_stack.fleet.version import Version

    header = {
        "headerId": int(time.time()),  # it must grow, and no file keeps the last one
        "timestamp": timestamp(time.time()),
        "version": robot.version,
        "manufacturer": robot.manufacturer,
        "serialNumber": robot.serial,
    }
    complete = {**header, **data}
    if "nodes" in data:
        complete = {"orderId": f"{Path(source).stem}-{secrets.token_hex(4)}", "orderUpdateId": 0, **complete}
    for name in ("manufacturer", "serialNumber"):
        if complete[name] != header[name]:
            raise CommandError(
                f"{source}: {name} is {complete[name]!r}, but the robot's is {header[name]!r}", WRONG_USE
            )
    version = Version.of(str(complete["version"]))
    if version is None or Version.of(robot.version) is not version:
        known = " and ".join(Version)
        text = f"version {complete['version']}, the robot's is {header['version']}; {known} can be checked and sent"
        raise CommandError(f"{source}: {text}", WRONG_USE)
    topic = Topic.ORDER if "nodes" in data else Topic.INSTANT_ACTIONS
    try:
        decode(topic, json.dumps(complete).encode(), LONGEST_PACKET_BYTES, version)
    except Refused as refused:
        raise CommandError(f"{source}: does not match the schema of VDA 5050: {refused}", WRONG_USE) from None
    if topic is Topic.ORDER and not any(node["released"] for node in complete["nodes"]):
        raise CommandError(f"{source}: releases no node", WRONG_USE)
    return complete


def _connected(broker: str | None, certificates: Path | None, folder: Path | None) -> Fleet:
    from robot_stack.cli.fleet_broker import Fleet, broker_params

    return Fleet(broker_params(_site(folder), broker, certificates))


def _site(folder: Path | None) -> Site:
    from robot_stack.cli.fleet_site import Site, default_folder

    return Site((folder or default_folder()).absolute())


def _print_commands(site: Site, serial: str, files: Files) -> None:
    print("copy this folder to the robot, there as its user's own with mode 0700, and start the robot with")
    settings = [f"fleet_agent.identity.serial_number={serial}"]
    settings += [
        f"fleet_agent.broker.{name}=/etc/robot_stack/fleet/{path.name}"
        for name, path in (("ca_file", files.ca), ("certificate_file", files.certificate), ("key_file", files.key))
    ]
    print(
        " \\\n  ".join(
            [f"robot-stack up --profile robot --fleet {site.robot_url()}", *(f"--set {item}" for item in settings)]
        )
    )


def _table(robots: Iterable[Robot]) -> Table:
    from rich.text import Text

    from robot_stack.cli.fleet_robots import COLUMNS
    from robot_stack.cli.tables import table

    made = table("Fleet", [(name, "left") for name in COLUMNS])
    for robot in sorted(robots, key=lambda item: item.prefix):
        made.add_row(*(Text(cell) for cell in robot.row()))
    return made
