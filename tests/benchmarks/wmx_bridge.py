"""The engine bridge: status reads and commands through it beside the simulated engine's own, in the same run."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import cast

from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.config import load_client_config, load_engine_config
from robot_stack.wmx.simulated.client import Device
from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile
from tests.benchmarks.support.own_engine import PRIORITY, Processes, go_first, own_environment
from tests.support.wmx.bridge import BridgeProcess, build

AIMS = {
    "bridge_status_read_us_p50": Aim("<", 30.0),
    "bridge_status_read_us_p99": Aim("<", 30.0),
    "bridge_request_us_p50": Aim("<", 200.0),
    "bridge_request_us_p99": Aim("<", 200.0),
}
_PAUSE_S = 0.002
_WARM = 200


def run(count: int = 2000, realtime: bool = True) -> Result:
    """A simulated engine of six axes, the bridge on it, and one client of each, which take turns.

    realtime: engine and bridge get the supervisor's priority, if permitted.
    """
    with (
        own_environment(1) as environment,
        tempfile.TemporaryDirectory(prefix="wmx-", dir="/dev/shm") as folder,
    ):
        program = build(Path(folder))
        engine_folder, bridge_folder = Path(environment["ROBOT_STACK_RUNTIME_DIR"]), Path(folder) / "run"
        start = Processes(environment, PRIORITY if realtime else 0)
        config = load_client_config()
        with start("robot_stack.wmx.engine_server"), connect("direct", config) as direct:
            n_axes, n_io = load_engine_config().n_axes, load_engine_config().n_output_bytes
            bridge = BridgeProcess(program, bridge_folder, engine_folder, n_axes, n_io)
            if start.priority:
                for thread in Path(f"/proc/{bridge.process.pid}/task").iterdir():
                    go_first(int(thread.name), start.priority)
            try:
                path = config.model_copy(update={"path": str(bridge_folder)})
                with connect("bridged", path) as bridged:
                    figures = _measure(direct, bridged, count)
            finally:
                bridge.kill()
    conditions = {
        "status_read": f"{count} reads of all axes each, in turns, {1e3 * _PAUSE_S:g} ms apart; repeated: no pause",
        "status_age": "time from the stamp of the status to its read",
        "command": "ClearAxisAlarm of one axis; the simulated engine answers at the end of its 1 ms cycle",
        "request": "one that the bridge itself answers: the client's and the bridge's part of a command",
        "realtime_priority": f"SCHED_RR {start.priority}" if start.priority else "none",
    }
    return Result(figures, conditions)


def _measure(direct: MotionEngine, bridged: MotionEngine, count: int) -> dict[str, float]:
    if direct.api.StartCommunication(10000):
        raise BenchError("communication does not start")
    ages: dict[str, list[float]] = {"": [], "bridge_": []}

    def status(engine: MotionEngine, prefix: str) -> int:
        code, snapshot = engine.read_status()
        ages[prefix].append(1e6 * snapshot.age_s(time.monotonic_ns()))
        return code

    def command(engine: MotionEngine) -> int:
        return engine.core_motion.axisControl.ClearAxisAlarm(0)

    def request() -> int:
        return cast(Device, bridged.api).command("no such request") - ErrorCode.NoSupportedFunction

    calls: dict[str, Callable[[], int]] = {
        "status_read": lambda: status(direct, ""),
        "bridge_status_read": lambda: status(bridged, "bridge_"),
        "command": lambda: command(direct),
        "bridge_command": lambda: command(bridged),
        "bridge_request": request,
    }
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(_WARM + count):
        for name, call in calls.items():
            time.sleep(_PAUSE_S)
            begin_ns = time.perf_counter_ns()
            code = call()
            if turn >= _WARM:
                taken[name].append(1e-3 * (time.perf_counter_ns() - begin_ns))
            if code:
                raise BenchError(f"{name}: error {code}")
    for prefix, engine in ("", direct), ("bridge_", bridged):
        taken[f"{prefix}status_read_repeated"] = repeated = []
        for _ in range(count):
            begin_ns = time.perf_counter_ns()
            engine.read_status()
            repeated.append(1e-3 * (time.perf_counter_ns() - begin_ns))
    taken |= {f"{prefix}status_age": values for prefix, values in ages.items()}
    return {
        f"{name}_us_p{round(100 * share)}": percentile(v, share) for name, v in taken.items() for share in (0.5, 0.99)
    }
