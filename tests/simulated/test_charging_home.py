"""A mission that ends on a low battery goes home to the charger; after a release the next order begins there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sensor_msgs.msg import BatteryState

from custom_msgs.action import Dock
from custom_msgs.msg import MissionOrder, MissionQueue
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import actions, services, topics
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from tests.simulated.stage import Stage, staged
from tests.support.environment import own_config

MISSION = """
id: hop
name: {en: Hop, ja: 走行, zh: 行驶}
home: {x: -0.5, y: 0.0, yaw: 0.0, dock: charger}
waypoints:
  - {name: end, x: 0.8, y: 0.0, yaw: 0.0, action: park}
"""
SOON = "mission_manager.next_order_after_s=1.0"
CHARGING = BatteryState.POWER_SUPPLY_STATUS_CHARGING
_Request = EditMissionQueue.Request


def edit(stage: Stage, operation: int) -> Any:
    order = MissionOrder(id="next", mission_id="hop", origin=MissionOrder.CLI, priority=100)
    return stage.call(services.EDIT_MISSION_QUEUE, _Request(operation=operation, order=order))


def test_a_low_battery_leads_to_the_charger_and_a_release_away_from_it(tmp_path: Path) -> None:
    docked = load_docks().docks["charger"]
    at_charger = docked.staging.pose().compose(Pose2(-1.5, 0.0, 0.0))
    with own_config(tmp_path, hop=MISSION), staged("yard", SOON, start=Pose2(0.0, 0.0, 0.0)) as stage:
        queue, battery = stage.listen(topics.MISSION_QUEUE), stage.listen(topics.BATTERY_STATE)
        stage.command("START_MISSION", "hop")
        stage.wait_faster(0.1, 20.0)
        stage.world.sim.battery.charge = 0.25
        stage.mission.wait(lambda message: message.current_waypoint == "home", "the way home", 20.0)
        stage.wait_mission("COMPLETED", 120.0)
        assert stage.at().distance_to(at_charger) < 0.02
        charged = battery.last.percentage
        assert battery.last.power_supply_status == CHARGING
        assert battery.last.current > 1.0
        assert edit(stage, _Request.ADD).success
        assert not edit(stage, _Request.RELEASE).success

        stage.assert_wheels_rest(2.0)
        assert battery.last.percentage > charged
        stage.world.sim.battery.charge = 0.95
        stage.assert_wheels_rest(3.0)
        assert queue.last.held_by != MissionQueue.NOTHING
        assert edit(stage, _Request.RELEASE).success
        stage.mission.wait(lambda message: message.state == "RUNNING", "the order", 30.0)
        stage.wait_mission("COMPLETED", 60.0)
        assert stage.at().distance_to(Pose2(0.8, 0.0, 0.0)) < 0.15
        assert stage.docking.last.state == "IDLE"
        assert battery.last.power_supply_status != CHARGING


def test_navigation_does_not_drive_off_with_a_wheelchair_latched_at_the_charger() -> None:
    with staged("yard", start=load_docks().docks["charger"].staging.pose()) as stage:
        result = stage.begin(actions.DOCK, Dock.Goal(dock_id="charger")).wait(60.0)
        assert result.success, result.reason
        stage.stack.faults.inject("wheelchair", value=60.0)
        stage.passenger.wait(lambda message: message.data, "the wheelchair", 2.0)
        docked = stage.at()
        stage.go(docked.compose(Pose2(1.5, 0.0, 0.0)))
        stage.plan.wait(lambda message: message.poses, "a plan", 5.0)
        stage.assert_wheels_rest(3.0)
        stage.drive(0.2)
        stage.wait(lambda: stage.at().distance_to(docked) > 0.6, "clear of the charger", 10.0)
        stage.let_go()
        stage.wait(lambda: stage.at().distance_to(docked) > 1.4, "the goal", 20.0)
