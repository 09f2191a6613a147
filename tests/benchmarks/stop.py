"""Emergency stop at 1 m/s with 150 kg aboard: from the message to zero wheel command, engine stop and standstill."""

from __future__ import annotations

import random
import statistics
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sim.settings import world_settings
from tests.benchmarks.support.framework import Aim, Result, percentile
from tests.benchmarks.support.own_engine import PRIORITY, go_first
from tests.benchmarks.support.stack import busy_loops, running_stack

if TYPE_CHECKING:
    from tests.benchmarks.nodes.stop_latency_meter import Stop, StopLatencyMeter

AIMS = {
    "message_to_zero_command_ms_p99": Aim("<", 20.0),
    "message_to_engine_stop_ms_p99": Aim("<", 20.0),
    "button_to_zero_command_ms_p99": Aim("<", 20.0),
    "button_to_engine_stop_ms_p99": Aim("<", 20.0),
    "busy_to_zero_command_ms_p99": Aim("<", 20.0),
    "busy_to_engine_stop_ms_p99": Aim("<", 20.0),
    "standstill_distance_m_max": Aim("<", 0.40),
    "runs": Aim(">=", 100),
}
_CHAIR_KG = 30.0  # config/robot.yaml chair_mass_kg, also the mass of the simulated wheelchair
_BUSY = 2


def run(
    runs: int = 100,
    other_runs: int = 50,
    speed_mps: float = 1.0,
    load_kg: float = 150.0,
    world: str = "flat",
    seed: int = 1,
) -> Result:
    """Forwards and backwards in turn, in the simulation on the system clock; distances are ground truth.

    runs: stopped by a message of this process. other_runs: stopped by the emergency-stop button, counted from its
    process's message, and stopped by a message of this process beside two busy loops at ordinary priority. load_kg:
    wheelchair and passenger together. seed: of the stop's phase within the controller's period.
    """
    from tests.benchmarks.nodes.stop_latency_meter import StopLatencyMeter

    with tempfile.TemporaryDirectory() as folder:
        settings = [
            *world_settings(world),
            "sim_world.wheelchair=true",
            "sim_world.attached_at_start=true",
            f"sim_world.passenger_mass_kg={load_kg - _CHAIR_KG}",
            f"mission_manager.journal_file={Path(folder) / 'mission.db'}",
        ]
        with running_stack("sim", settings, system_time=True):
            # The meter must not wait for the processor behind the processes it measures.
            first = go_first(0, PRIORITY)
            with StopLatencyMeter(random.Random(seed)) as stopper:
                stopper.begin(passenger=True)
                by_message = _stops(stopper, stopper.stop, runs, speed_mps)
                by_button = _stops(stopper, stopper.press, other_runs, speed_mps)
                with busy_loops(_BUSY):
                    beside = _stops(stopper, stopper.stop, other_runs, speed_mps)
    distances_m = [stop.distance_m for stop in (*by_message, *by_button, *beside)]
    return Result(
        {
            **_latencies("message", by_message),
            **_latencies("button", by_button),
            **_latencies("busy", beside),
            "standstill_distance_m_max": max(distances_m),
            "standstill_distance_m_mean": statistics.fmean(distances_m),
            "standstill_s_max": max(stop.standstill_s for stop in by_message),
            "runs": len(by_message),
        },
        {
            "speed_at_stop_mps_min": round(min(stop.speed_mps for stop in by_message), 3),
            "stops_by_delay": stopper.delays,
            "profile": "sim on the system clock",
            "world": world,
            "other_runs": other_runs,
            "realtime_priority_of_the_meter": PRIORITY if first else 0,
        },
    )


def _stops(stopper: StopLatencyMeter, stop: Callable[[], Stop], runs: int, speed_mps: float) -> list[Stop]:
    stops = []
    for number in range(runs):
        stopper.drive(speed_mps if number % 2 == 0 else -speed_mps)
        stops.append(stop())
        stopper.release()
    return stops


def _latencies(name: str, stops: Sequence[Stop]) -> dict[str, float]:
    zero_ms = [1e3 * stop.zero_command_s for stop in stops]
    engine_ms = [1e3 * stop.engine_stop_s for stop in stops]
    return {
        f"{name}_to_zero_command_ms_p99": percentile(zero_ms, 0.99),
        f"{name}_to_zero_command_ms_p50": percentile(zero_ms, 0.5),
        f"{name}_to_engine_stop_ms_p99": percentile(engine_ms, 0.99),
        f"{name}_to_engine_stop_ms_p50": percentile(engine_ms, 0.5),
    }
