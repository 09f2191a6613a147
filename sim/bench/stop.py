"""Emergency stop at 1 m/s with 150 kg aboard: from the message to zero wheel command, engine stop and standstill."""

from __future__ import annotations

import random
import statistics
import tempfile
import time
from pathlib import Path

from robot_stack.bench.framework import Aim, Result, percentile
from robot_stack.bench.own_engine import PRIORITY, go_first
from robot_stack.bench.stack import running_stack
from sim.settings import world_settings

NAME = "stop"
AIMS = {
    "message_to_zero_command_ms_p99": Aim("<", 20.0),
    "message_to_engine_stop_ms_p99": Aim("<", 20.0),
    "standstill_distance_m_max": Aim("<", 0.40),
    "runs": Aim(">=", 100),
}
_CHAIR_KG = 30.0  # config/robot.yaml chair_mass_kg, which the simulated wheelchair weighs


def run(runs: int = 100, speed_mps: float = 1.0, load_kg: float = 150.0, world: str = "flat", seed: int = 1) -> Result:
    """Forwards and backwards in turn, in the simulation at real time; distances are ground truth.

    load_kg: wheelchair and passenger together. seed: of the moment of the stop within the controller's period.
    """
    from robot_stack.bench.nodes.stopper import Stopper

    moment = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        settings = [
            *world_settings(world),
            "sim_world.wheelchair=true",
            "sim_world.attached_at_start=true",
            f"sim_world.passenger_mass_kg={load_kg - _CHAIR_KG}",
            f"mission_manager.journal_file={Path(folder) / 'mission.db'}",
        ]
        stops = []
        with running_stack("sim", settings):
            # Who looks must not wait for the processor behind those it looks at.
            first = go_first(0, PRIORITY)
            with Stopper() as stopper:
                stopper.begin(passenger=True)
                for number in range(runs):
                    stopper.drive(speed_mps if number % 2 == 0 else -speed_mps)
                    time.sleep(moment.uniform(0.0, 0.05))
                    stops.append(stopper.stop())
                    stopper.release()
    zero_ms = [1e3 * stop.zero_command_s for stop in stops]
    engine_ms = [1e3 * stop.engine_stop_s for stop in stops]
    distances_m = [stop.distance_m for stop in stops]
    return Result(
        {
            "message_to_zero_command_ms_p99": percentile(zero_ms, 0.99),
            "message_to_zero_command_ms_p50": percentile(zero_ms, 0.5),
            "message_to_engine_stop_ms_p99": percentile(engine_ms, 0.99),
            "message_to_engine_stop_ms_p50": percentile(engine_ms, 0.5),
            "standstill_distance_m_max": max(distances_m),
            "standstill_distance_m_mean": statistics.fmean(distances_m),
            "standstill_s_max": max(stop.standstill_s for stop in stops),
            "runs": len(stops),
        },
        {
            "speed_at_stop_mps_min": round(min(stop.speed_mps for stop in stops), 3),
            "stops_by_delay": stopper.delays,
            "profile": "sim",
            "world": world,
            "realtime_priority_of_the_meter": PRIORITY if first else 0,
        },
    )
