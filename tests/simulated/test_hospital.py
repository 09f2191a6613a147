"""The whole robot on a site of its own: through a corridor and a door opening, by a map from a floor plan."""

from __future__ import annotations

import math
import os

from robot_stack.core.config import SITE_VARIABLE
from robot_stack.core.geometry import Pose2
from tests.simulated.stage import staged

_START, _BEDSIDE = Pose2(9.0, 0.0, -math.pi / 4), Pose2(10.0, -3.6, -math.pi / 2)


def test_the_robot_rides_from_the_corridor_to_a_bed_by_the_plan_of_the_floor() -> None:
    errors_m: list[float] = []
    with staged("hospital", start=_START) as stage:
        assert os.environ[SITE_VARIABLE] == "hospital"

        def there() -> bool:
            if stage.stands:
                errors_m.append(stage.estimate_error_m())
            return stage.at().distance_to(_BEDSIDE) < 0.1 and stage.stands

        stage.go(_BEDSIDE)
        stage.wait(there, "the bedside", 60.0)
    assert max(errors_m) < 0.1
