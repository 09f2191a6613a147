"""A warning precedes every autonomous motion from standstill, whichever node requests it."""

from __future__ import annotations

import json

from robot_stack.contract import topics
from robot_stack.contract.display import Display
from robot_stack.core.config import load
from robot_stack.core.departure import DepartureParams
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import pose_from_msg, time_to_s
from tests.simulated.shared import shared
from tests.simulated.stage import staged

DEPARTURE = load(DepartureParams, "departure")


@shared(staged)
def test_a_goal_by_hand_is_announced_before_it_moves_the_robot() -> None:
    with staged() as stage:
        shown, warnings = stage.listen(topics.SIM_EHMI_DISPLAY), stage.listen(topics.DEPARTURE_WARNING)
        shown.wait(lambda message: json.loads(message.data)["state"] == Display.IDLE, "a display at rest")
        stage.run(DEPARTURE.after_s + 1.0)
        asked_s = stage.now_s
        stage.go(pose_from_msg(stage.pose.last.pose).compose(Pose2(1.5, 0.0, 0.0)))
        shown.wait(lambda message: json.loads(message.data)["state"] == Display.NAVIGATING, "the light of driving")
        assert stage.stands, "light first, then motion"
        stage.wait(lambda: stage.speed_mps > 0.02, "motion")
        moved_s = stage.now_s
        stage.wait_faster(0.3)
        assert {message.frame_id for message in warnings.messages} == {"navigation_controller"}
        announced_s = [time_s for time_s in warnings.times_s if asked_s < time_s]
        assert moved_s - announced_s[0] > 0.9 * DEPARTURE.warning_s
        assert moved_s >= announced_s[-1] - 0.1
        assert len(announced_s) > 0.5 * DEPARTURE.warning_s * 10.0, "the warning is repeated until the departure"
        stamps = {time_to_s(message.stamp) for message in warnings.messages}
        assert max(stamps) - min(stamps) < 0.3, "one departure"
        stage.wait_stands()
        assert json.loads(shown.last.data)["state"] in (Display.NAVIGATING, Display.IDLE)
        shown.wait(lambda message: json.loads(message.data)["state"] == Display.IDLE, "a display at rest again")
