"""SIGKILL and SIGSTOP of processes: the robot ends in a declared state, and the supervisor restarts the process."""

from __future__ import annotations

import pytest

from tests.simulated.shared import shared
from tests.simulated.stage import Stage, staged

pytestmark = shared(staged)


def drive_again(stage: Stage, name: str) -> None:
    """Releases the stop that the kill may have left, and drives with the restarted process."""
    stage.let_go()
    stage.wait_restarted(name)
    stage.run(2.0)
    if stage.safety.last.safety_state == "EMERGENCY_STOP":
        stage.release()
    stage.wait_safety("NORMAL", limit_s=20.0)
    stage.drive_at(0.3)


# The safety monitor: below.
@pytest.mark.parametrize("name", ["swerve_hardware_interface", "swerve_controller", "ndt_localization"])
def test_a_critical_process_is_killed_and_the_robot_stands(name: str) -> None:
    with staged() as stage:
        stage.drive_at(0.6)
        stage.kill(name)
        stage.wait_stands(6.0)
        drive_again(stage, name)


def test_killed_button_process_restarts_and_stops_the_robot() -> None:
    """It may restart within the second that NODE_DEAD takes, so a press must not be missed."""
    with staged() as stage:
        stage.drive_at(0.6)
        stage.kill("emergency_stop_button")
        stage.inject("estop_button", value=1.0)
        stage.wait_restarted("emergency_stop_button")
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stage.wait_stands(6.0)
        stage.let_go()
        stage.inject("estop_button", value=0.0)
        stage.release()
        # A button whose process hangs may miss a press, so a comfort stop is not enough.
        stage.drive_at(0.6)
        stage.hang("emergency_stop_button", 5.0)
        stage.wait_safety("EMERGENCY_STOP", "ESTOP_PRESSED")
        stage.wait_stands(6.0)
        stage.let_go()
        stage.wait_restarted("emergency_stop_button")
        stage.run(1.0)
        stage.release()


@pytest.mark.parametrize("hangs", [False, True])
def test_without_its_safety_monitor_the_robot_brakes_hard(hangs: bool) -> None:
    """With a passenger at 1.0 m/s: 0.18 m of silence, 0.25 m of braking, and a tick. A comfort stop takes 1.6 m."""
    with staged() as stage:
        stage.drive_at(1.0)  # the ground ahead is seen from here on
        stage.board(True)
        stage.limit.wait(lambda message: "PASSENGER_ONBOARD" in message.reason, "the passenger's limit")
        stage.drive_at(1.0)
        begun = stage.at()
        if hangs:
            stage.hang("safety_monitor", 8.0)
        else:
            stage.kill("safety_monitor")
        stage.wait_stands(8.0)
        assert stage.at().distance_to(begun) < 0.5
        drive_again(stage, "safety_monitor")


def test_another_process_hangs_and_the_robot_is_slow() -> None:
    """A hang instead of a kill: a killed process restarts within the second that NODE_DEAD takes."""
    with staged() as stage:
        stage.drive_at(1.0)
        stage.hang("navigation_controller", 3.0)
        stage.wait_safety("DEGRADED", "NODE_DEAD")
        stage.limit.wait(lambda m: "NODE_DEAD" in m.reason and m.max_linear_velocity <= 0.5, "the limit")
        stage.wait_safety("NORMAL", limit_s=20.0)


@pytest.mark.parametrize("seconds", [0.8, 2.0])
def test_a_pause_of_the_computer_ends_in_a_stop_that_an_operator_can_release(seconds: float) -> None:
    """All processes pause, as on a paused virtual machine; motion engine and robot continue."""
    with staged() as stage:
        stage.drive_at(0.4)
        for row in stage.stack.plan.processes:
            stage.hang(row.name, seconds)
        stage.wait_safety("EMERGENCY_STOP")
        stage.wait_stands(5.0)
        stage.let_go()
        stage.release()
        stage.wait_safety("NORMAL")


def test_the_world_and_its_engine_are_killed() -> None:
    with staged() as stage:
        stage.drive_at(0.6)
        stage.kill("sim_world")
        stage.wait_safety("EMERGENCY_STOP", "DRIVE_FAULT")
        stage.let_go()
        stage.wait_restarted("sim_world")
        stage.run(5.0)
        stage.release()
        stage.wait_safety("NORMAL")
        stage.drive_at(0.3)


def test_a_latched_stop_survives_the_monitor() -> None:
    with staged() as stage:
        stage.drive_at(0.6)
        stage.estop(True)
        stage.wait_safety("EMERGENCY_STOP")
        stage.run(0.2)
        stage.estop(False)
        stage.kill("safety_monitor")
        killed_s = stage.now_s
        stage.wait_restarted("safety_monitor")
        stage.safety.wait_next(10)
        assert stage.safety_states(killed_s) == {"EMERGENCY_STOP"}
        assert stage.stands


def test_a_mission_survives_its_manager_and_waits_for_a_person() -> None:
    with staged() as stage:
        stage.command("START_MISSION", "short_hop")
        stage.wait_mission("RUNNING")
        stage.wait_faster(0.2)
        stage.kill("mission_manager")
        stage.wait_restarted("mission_manager")
        assert stage.wait_mission("PAUSED").mission_id == "short_hop"
        stage.wait_stands()
        stage.wait_safety("NORMAL")
        stage.command("RESUME")
        stage.wait_mission("RUNNING")
        stage.wait_mission("COMPLETED", 60.0)
