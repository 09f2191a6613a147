"""From the newest LiDAR point to obstacles and to the costmap, on the running stack, while the robot drives."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from robot_stack.contract import topics
from tests.benchmarks.support.commands import robot_stack
from tests.benchmarks.support.framework import Aim, BenchError, Result, percentile
from tests.benchmarks.support.stack import running_stack

if TYPE_CHECKING:
    from tests.benchmarks.nodes.latency import LatencyMeter

AIMS = {"points_to_obstacles_ms_p95": Aim("<", 50.0), "points_to_costmap_ms_p95": Aim("<", 80.0)}
_ROWS = {"obstacles": topics.OBSTACLES, "unseen": topics.UNSEEN_SPACE, "costmap": topics.LOCAL_COSTMAP}
_SETTLE_S = 8.0


def run(
    duration_s: float = 30.0, profile: str = "sim", mission: str = "yard_tour", picture: str = "results/perception.png"
) -> Result:
    """mission: driven meanwhile; empty: at rest. picture: of the last obstacles and costmap; empty: none."""
    from tests.benchmarks.nodes.latency import LatencyMeter

    with tempfile.TemporaryDirectory() as folder:
        journal = f"mission_manager.journal_file={Path(folder) / 'mission.db'}"
        with (
            running_stack(profile, own=[journal], system_time=True) as status,
            LatencyMeter(list(_ROWS.values())) as meter,
        ):
            if mission:
                robot_stack("reset", check=False)
                robot_stack("mission", "start", mission, check=False)
            try:
                meter.run(_SETTLE_S)
                meter.run(duration_s)
            finally:
                if mission:
                    robot_stack("mission", "abort", check=False)
            return _result(meter, duration_s, len(status["processes"]), Path(picture) if picture else None)


def _result(meter: LatencyMeter, duration_s: float, processes: int, picture: Path | None) -> Result:
    figures: dict[str, float] = {}
    for name, row in _ROWS.items():
        ages_s = meter.ages_s[row.name]
        if name == "obstacles" and not ages_s:
            raise BenchError(f"no message on {row.name}: see `robot-stack status`")
        if ages_s:
            figures[f"points_to_{name}_ms_p50"] = 1e3 * percentile(ages_s, 0.5)
            figures[f"points_to_{name}_ms_p95"] = 1e3 * percentile(ages_s, 0.95)
            figures[f"{name}_hz"] = len(ages_s) / duration_s
    drawn = ""
    if picture is not None:
        from tests.benchmarks.nodes.perception_picture import draw

        drawn = str(draw(picture, meter.latest))
    missing = [row.name for row in _ROWS.values() if not meter.ages_s[row.name]]
    return Result(figures, {"processes": processes, "no message on": missing, "picture": drawn})
