"""The whole robot in a site with a one-way zone: it comes by the zone and returns by another way."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE
from tests.simulated.stage import staged

# From the depot's wall to the planter beside it: northwards only. The other way is east of the planter, x 1.3 to 2.0.
_LANE_X_M, _LANE_Y_M = (-7.5, 1.6), (5.5, 7.5)
_NORTH, _SOUTH = Pose2(0.2, 9.0, 1.57), Pose2(0.2, 4.0, -1.57)


def test_the_robot_returns_by_the_way_that_a_one_way_zone_leaves(tmp_path: Path) -> None:
    folder = shutil.copytree(map_folder("yard"), tmp_path / "yard")
    (x0, x1), (y0, y1) = _LANE_X_M, _LANE_Y_M
    lane = {
        "type": "Feature",
        "properties": {"name": "lane", "type": "one_way", "heading_deg": 90.0},
        "geometry": {"type": "Polygon", "coordinates": [[[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]]},
    }
    (folder / ZONES_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": [lane]}))
    at_lane_m: list[float] = []

    with staged("yard", f'navigation_controller.map="{folder}"', start=Pose2(0.2, 4.0, 1.57)) as stage:

        def drive(goal: Pose2) -> list[float]:
            """x where the robot is beside the planter."""
            at_lane_m.clear()
            stage.go(goal)
            stage.wait(
                lambda: _noted(stage.at()) and stage.at().distance_to(goal) < 0.05 and stage.stands, "there", 90.0
            )
            return list(at_lane_m)

        def _noted(pose: Pose2) -> bool:
            if y0 < pose.y < y1:
                at_lane_m.append(pose.x)
            return True

        assert max(drive(_NORTH)) < 1.6
        assert min(drive(_SOUTH)) > 1.6
