"""What the live view costs: without a viewer, and with one that looks at every topic of the running stack."""

from __future__ import annotations

import json
import re
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import psutil
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.stack import cpu_pct, pss_mb, running_stack

AIMS = {"cpu_pct": Aim("<", 0.5), "viewer_cpu_pct": Aim("<", 25.0)}
_COMMAND = [sys.executable, "-m", "robot_stack.cli", "view", "--port", "0"]
_SETTLE_S = 3.0
_JOIN_S = 10.0


def run(duration_s: float = 20.0, profile: str = "sim") -> Result:
    """cpu_pct, viewer_cpu_pct: of the live view's process, of one core, without and with a viewer on all topics.

    messages_per_s, megabytes_per_s: what that viewer received.
    """
    with running_stack(profile), _view() as (process, port):
        time.sleep(_SETTLE_S)
        idle_pct = cpu_pct(process, duration_s)
        with connect(
            f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=2**26
        ) as connection:
            viewer = _Viewer(connection)
            time.sleep(_SETTLE_S)
            before = viewer.messages, viewer.bytes
            viewed_pct = cpu_pct(process, duration_s)
            messages, received = viewer.messages - before[0], viewer.bytes - before[1]
        viewer.join()
        memory_mb = pss_mb(process)
    if not messages:
        raise BenchError("the viewer received nothing")
    figures = {
        "cpu_pct": idle_pct,
        "viewer_cpu_pct": viewed_pct,
        "messages_per_s": messages / duration_s,
        "megabytes_per_s": 1e-6 * received / duration_s,
        "pss_mb": memory_mb,
    }
    return Result(figures, {"profile": profile, "channels": viewer.channels})


@contextmanager
def _view() -> Iterator[tuple[psutil.Process, int]]:
    """The live view as a process, and its port."""
    process = subprocess.Popen(_COMMAND, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        found = re.search(r"ws://127\.0\.0\.1:(\d+)", first)
        if found is None:
            raise BenchError(f"the live view did not start: {first.strip()}")
        yield psutil.Process(process.pid), int(found.group(1))
    finally:
        process.terminate()
        process.wait()


class _Viewer:
    """Subscribes to every channel and counts the received messages, in a thread of its own."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection
        self.channels = self.messages = self.bytes = 0
        self._thread = threading.Thread(target=self._read, name="viewer", daemon=True)
        self._thread.start()

    def join(self) -> None:
        self._thread.join(_JOIN_S)

    def _read(self) -> None:
        try:
            for item in self._connection:
                if isinstance(item, bytes):
                    struct.unpack_from("<BIQ", item)
                    self.messages, self.bytes = self.messages + 1, self.bytes + len(item)
                else:
                    self._look(json.loads(item))
        except ConnectionClosed:
            pass

    def _look(self, message: dict[str, Any]) -> None:
        if message["op"] != "advertise":
            return
        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in message["channels"]]
        self.channels += len(wanted)
        self._connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
