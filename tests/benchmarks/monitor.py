"""What the system monitor costs, its rate, and how soon the rows of computer and links are raised."""

from __future__ import annotations

import os
import time

from robot_stack.contract import topics
from tests.benchmarks.nodes.monitor_trial import ROWS
from tests.benchmarks.support.framework import Aim, BenchError, Result
from tests.benchmarks.support.stack import Load, running_stack
from tests.benchmarks.support.trial import run_trial

# Seconds within which a row must be raised; a link's from its last heartbeat.
_LIMITS_S = {"CPU_HIGH": 10.0, "EHMI_LINK_LOST": 5.0, "UI_LINK_LOST": 5.0}
_MARGIN_S = 0.5
AIMS = {
    "cpu_pct": Aim("<", 2.0),
    "robot_status_hz_error": Aim("<", 0.1),
    **{f"{code.lower()}_s": Aim("<=", _LIMITS_S.get(code, 0.0) + _MARGIN_S) for code in ROWS},
}
_NODE = "system_monitor"
_SETTLE_S = 10.0
_TRIAL_S = 180.0
_TRIAL = "tests.benchmarks.nodes.monitor_trial"


def run(duration_s: float = 60.0, profile: str = "sim") -> Result:
    """cpu_pct, robot_status_hz: of the standing stack on the system clock, as on a robot, with subscribed diagnostics.

    The rows: two processes in a ROS domain of their own; this benchmark simulates computer, displays and screens.
    Raises BenchError where user namespaces are not allowed: the full disk is a small file system of its own.
    """
    from robot_stack.system_monitor.nodes.topic_meter import Meter

    with (
        running_stack(profile, system_time=True) as status,
        Meter([topics.ROBOT_STATUS, topics.DIAGNOSTICS_AGG]) as meter,
    ):
        meter.settle(_SETTLE_S)
        load, begun_s = Load(status), time.monotonic()
        meter.run(duration_s)
        cores = load.cores_by_process(time.monotonic() - begun_s)
        rate_hz = meter.seen()[topics.ROBOT_STATUS.name].traffic.rate_hz
    if _NODE not in cores:
        raise BenchError(f"{_NODE} does not run in profile {profile}")
    raised_s = run_trial(_TRIAL, lambda folder: [str(folder / "computer")], _TRIAL_S)
    return Result(
        {
            "cpu_pct": 100.0 * cores[_NODE],
            "robot_status_hz": rate_hz,
            "robot_status_hz_error": abs(rate_hz - topics.ROBOT_STATUS.nominal_rate_hz),
            **{f"{code.lower()}_s": raised_s[code] for code in ROWS},
        },
        {"profile": profile, "processes": len(status["processes"]), "load": os.getloadavg()[0]},
    )
