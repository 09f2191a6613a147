"""What a node costs that has nothing to do, what a wake-up costs, and what a received message."""

from __future__ import annotations

import os
import subprocess
import sys
import time

from tests.benchmarks.support.framework import ROOT, Aim, BenchError, Result
from tests.benchmarks.support.stack import Load, running_stack

AIMS = {"cpu_pct": Aim("<", 1.0)}
_NODE = "emergency_stop_button"
_INPUTS = 10
_MESSAGE_HZ = 50.0


def run(duration_s: float = 20.0, profile: str = "sim") -> Result:
    """cpu_pct: of the emergency-stop button in the standing stack. The rest: a node of this stack in this process, with
    ten inputs without callbacks and a tick of 50 Hz, first without messages, then with ten topics of 50 Hz each.
    """
    with running_stack(profile) as status:
        load = Load(status)
        begun_s = time.monotonic()
        time.sleep(duration_s)
        cores = load.cores_by_process(time.monotonic() - begun_s)
    if _NODE not in cores:
        raise BenchError(f"{_NODE} does not run in profile {profile}")
    silent_us, _ = _listener(duration_s, messages=False)
    busy_us, count = _listener(duration_s, messages=True)
    return Result(
        {
            "cpu_pct": 100.0 * cores[_NODE],
            "wakeup_us": silent_us / (_MESSAGE_HZ * duration_s),
            "message_us": (busy_us - silent_us) / max(count, 1),
            "messages_500hz_cpu_pct": 1e-4 * busy_us / duration_s,
        },
        {"node": _NODE, "inputs": _INPUTS, "tick_hz": _MESSAGE_HZ, "messages": count, "load": os.getloadavg()[0]},
    )


def _listener(duration_s: float, *, messages: bool) -> tuple[float, int]:
    """Processor time in us and received messages of a node that subscribes for ``duration_s``, in its own process."""
    command = [sys.executable, "-m", "tests.benchmarks.nodes.listener"]
    options = [str(_INPUTS), str(_MESSAGE_HZ), str(duration_s)]
    sender = subprocess.Popen([*command, "send", *options], cwd=ROOT) if messages else None
    try:
        done = subprocess.run([*command, "listen", *options], cwd=ROOT, capture_output=True, text=True, check=False)
    finally:
        if sender is not None:
            sender.terminate()
            sender.wait()
    if done.returncode:
        raise BenchError(f"the listener ended with code {done.returncode}: {done.stderr.strip()}")
    used_us, count = done.stdout.split()
    return float(used_us), int(count)
