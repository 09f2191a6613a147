"""Fleet managers and a robot by foreign implementations of VDA 5050: vda5050-sdk and vda-5050-lib.

    python -m tests.support.fleet.foreign_masters BROKER_URL ORDER_FILE

lets vda5050-sdk order a running robot, of the default names, and prints what it saw. Exit code 1 if the order was
refused or did not end within an hour.
"""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from vda5050.client.master.client import MasterClient
from vda5050.config import MasterConfig
from vda5050.model.enums import OperatingMode
from vda5050.model.order import Order
from vda5050.model.state import State

from tests.support.waiting import wait_for

_REFUSALS = ("validationError", "orderError", "orderUpdateError", "noRouteError")
NPM = Path(__file__).with_name("npm")


@dataclass
class Followed:
    """nodes: ids of the last nodes that the states named, without repetition. refused: by the robot, in a state."""

    accepted: bool
    finished: bool
    refused: bool = False
    nodes: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


def drive_by_sdk(
    url: str, manufacturer: str, serial: str, *orders: dict[str, Any], deadline_s: float = 60.0
) -> Followed:
    """Sends an order by vda5050-sdk (Python, 2.1.0), which checks every state against the official schema.

    orders: the order, then its updates, each of which is sent when the robot asks for more of the base.
    """
    # In a thread of its own: a browser driven earlier by the same process leaves its event loop in this one.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, _drive(url, f"{manufacturer}/{serial}", orders, deadline_s)).result()


async def _drive(url: str, key: str, messages: tuple[dict[str, Any], ...], deadline_s: float) -> Followed:
    manufacturer, serial = key.split("/")
    header = {"headerId": 0, "timestamp": "2026-01-01T00:00:00Z", "version": "2.1.0"}
    order, *updates = [
        Order.model_validate({**header, **data, "manufacturer": manufacturer, "serialNumber": serial})
        for data in messages
    ]
    followed = Followed(accepted=False, finished=False)
    async with MasterClient(MasterConfig(broker_url=url, validate_messages=True)) as master:

        def note(state: State, _key: object) -> None:
            followed.refused = followed.refused or _refused(state)
            if state.order_id == order.order_id and [state.last_node_id] != followed.nodes[-1:]:
                followed.nodes.append(state.last_node_id)

        master.on_state(note)
        master.on_error(lambda event: followed.errors.append(str(event)))
        master.on_vehicle_error(lambda event, _key: followed.errors.append(event.error.error_type))
        if not await master.wait_for(key, lambda session: session.state is not None, timeout=deadline_s):
            followed.errors.append("no state")
            return followed
        # Otherwise the order is refused.
        if not await master.wait_for(key, lambda session: _takes_orders(session.state), timeout=deadline_s):
            followed.errors.append("not automatic, or not localized")
            return followed
        result = await master.dispatch(order, key)
        followed.accepted = result.accepted
        followed.errors += [str(result.detail)] if not result.accepted else []
        for update in updates if followed.accepted else ():
            if not await master.wait_for(key, lambda session: _goes_on(session.state), timeout=deadline_s):
                followed.errors.append("no request for a base")
                return followed
            if followed.refused:
                return followed
            order = update
            followed.accepted = (await master.dispatch(update, key)).accepted
        if followed.accepted:
            ended = await master.wait_for(key, lambda session: _ended(session.state, order), timeout=deadline_s)
            followed.finished = ended and not followed.refused
    return followed


def _takes_orders(state: State) -> bool:
    at = state.agv_position
    return state.operating_mode is OperatingMode.AUTOMATIC and at is not None and at.position_initialized


def _refused(state: State) -> bool:
    return any(error.error_type in _REFUSALS for error in state.errors)


def _goes_on(state: State) -> bool:
    return bool(state.new_base_request) or _refused(state)


def _ended(state: State, order: Order) -> bool:
    return _refused(state) or (
        (state.order_id, state.order_update_id) == (order.order_id, order.order_update_id)
        and not state.node_states
        and state.last_node_sequence_id == order.nodes[-1].sequence_id
        and not state.driving
    )


def drive_by_npm(
    folder: Path, url: str, manufacturer: str, serial: str, order: dict[str, Any], while_running: Callable[[], None]
) -> Followed:
    """Sends ``order`` by vda-5050-lib (JavaScript). folder: of ``installed_npm``. while_running: called until the end.

    It knows versions 1.1 and 2.0.0: its order says 2.0.0, and it does not check the robot's messages of 2.1.0.
    """
    command = ["node", "master.js", url, manufacturer, serial, json.dumps(order)]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as process:

        def ended() -> bool:
            while_running()
            return process.poll() is not None

        try:
            wait_for(ended, "the end of the order")
        finally:
            process.kill()
        output = process.communicate()[0]
    return Followed(**json.loads(output.splitlines()[-1]))


@contextmanager
def npm_robot(folder: Path, url: str, manufacturer: str, serial: str) -> Iterator[None]:
    """The virtual AGV of vda-5050-lib at the node ``start`` of the map ``yard``. folder: of ``installed_npm``."""
    command = ["node", "virtual_agv.js", url, manufacturer, serial]
    with subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield
        finally:
            process.kill()


def installed_npm(folder: Path) -> Path:
    """Installs vda-5050-lib, as its lock file says, into ``folder``. Skips the test where that is not possible."""
    if shutil.which("npm") is None:
        pytest.skip("no npm on this machine")
    shutil.copytree(NPM, folder, dirs_exist_ok=True)
    done = subprocess.run(["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund"], cwd=folder, capture_output=True)
    if done.returncode:
        pytest.skip("vda-5050-lib cannot be downloaded")
    return folder


def main(url: str, file: Path) -> int:
    order = {"orderId": f"sdk-{time.time_ns()}", "orderUpdateId": 0, **json.loads(file.read_text(encoding="utf-8"))}
    followed = drive_by_sdk(url, "robot_stack", "robot_1", order, deadline_s=3600.0)
    print(followed)
    return 0 if followed.finished else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2])))
