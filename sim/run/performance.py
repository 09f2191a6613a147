"""Cost of a simulated millisecond: ``python -m sim.run.performance`` prints CPU time per cycle, by part, as JSON."""

from __future__ import annotations

import argparse
import json
import math
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from robot_stack.core.geometry import Twist2
from robot_stack.core.robot import load_robot
from robot_stack.wmx.engine_server.server import EngineServer
from sim.params import load_sim_params
from sim.plant.rig import Rig, TwistController
from sim.plant.world import Setup
from sim.worldfile import load_world

_WARM_UP_S = 2.0


def measure(world: str, seconds: float, passenger_kg: float | None) -> dict[str, float]:
    """CPU microseconds per cycle while the robot drives a curve, the engine behind its server as in the process."""
    attached = passenger_kg is not None
    file = load_world(world)
    setup = Setup(file, 1, file.start.pose(), attached, attached, passenger_kg or 0.0)
    rig = Rig(load_robot(), load_sim_params(), setup)
    sim = rig.sim
    requested = Twist2(0.5, 0.1, 0.4)
    rig.run(_WARM_UP_S, TwistController(rig.robot, lambda _: requested, attached), lambda _: None)
    with tempfile.TemporaryDirectory() as folder:
        server = EngineServer(rig.engine.engine, Path(folder))
        spent = _Stopwatch()
        sim.engine_cycle = spent.timed("engine", server.cycle)
        sim.world.step = spent.timed("drives_and_physics", sim.world.step)  # type: ignore[method-assign]
        begun_s, cycles = time.process_time(), round(seconds / sim.world.dt_s)
        for _ in range(cycles):
            sim.step()
            rig.faults.update()
        total_s = time.process_time() - begun_s
        server.close()
    result = {f"{name}_us": 1e6 * value / cycles for name, value in spent.total_s.items()}
    result["total_us"] = 1e6 * total_s / cycles
    result["core_share_at_real_time"] = total_s / seconds
    assert math.isfinite(sim.world.truth().position_m[0])
    return result


class _Stopwatch:
    def __init__(self) -> None:
        self.total_s: dict[str, float] = {}

    def timed(self, name: str, work: Callable[[], None]) -> Callable[[], None]:
        self.total_s[name] = 0.0

        def run() -> None:
            begun_s = time.thread_time()
            work()
            self.total_s[name] += time.thread_time() - begun_s

        return run


def main() -> None:
    parser = argparse.ArgumentParser(prog="performance", description="CPU time of a simulated millisecond.")
    parser.add_argument("--world", default="yard")
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated")
    options = parser.parse_args()
    figures = {
        "empty": measure(options.world, options.seconds, None),
        "with_150_kg": measure(options.world, options.seconds, 120.0),
    }
    conditions = {"machine": platform.machine(), "python": platform.python_version(), "world": options.world}
    print(json.dumps({"name": "simulation", "figures": figures, "conditions": conditions}, indent=2))


if __name__ == "__main__":
    main()
