"""The whole robot in a site with a route graph: a long goal is driven to over the lanes."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from robot_stack.core.geometry import Pose2
from robot_stack.core.route_graph import GRAPH_FILE
from robot_stack.core.site_map import map_folder
from tests.simulated.stage import staged

# East of the planter beside the depot; the straight way to the goal leads west of it.
_NODES_M = ((0.2, 3.0), (3.3, 4.5), (3.3, 8.5), (0.2, 9.5))
_START, _GOAL = Pose2(0.2, 3.0, 1.57), Pose2(0.2, 9.5, 3.14)


def test_a_long_goal_is_driven_to_over_the_lanes(tmp_path: Path) -> None:
    folder = shutil.copytree(map_folder("yard"), tmp_path / "yard")
    nodes = [
        {"type": "Feature", "properties": {"id": i}, "geometry": {"type": "Point", "coordinates": list(place)}}
        for i, place in enumerate(_NODES_M)
    ]
    edges = [
        {
            "type": "Feature",
            "properties": {"id": 10 + i, "startid": i, "endid": i + 1, "metadata": {"abs_speed_limit": 0.9}},
            "geometry": {"type": "MultiLineString"},
        }
        for i in range(3)
    ]
    (folder / GRAPH_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": nodes + edges}))
    beside_m: list[float] = []
    speeds: list[float] = []
    with staged("yard", f'navigation_controller.map="{folder}"', start=_START) as stage:

        def there() -> bool:
            if 5.5 < stage.at().y < 7.5:
                beside_m.append(stage.at().x)
                speeds.append(stage.speed_mps)
            return stage.at().distance_to(_GOAL) < 0.05 and stage.stands

        stage.go(_GOAL)
        stage.wait(there, "the goal", 90.0)
        assert beside_m
        assert max(abs(x - 3.3) for x in beside_m) < 0.5
        assert max(speeds) < 0.95
