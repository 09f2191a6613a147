"""Rows of the fault list on the running stack: the fault, the row in /safety/status, and the action by ground truth."""

from __future__ import annotations

import pytest

from tests.simulated.faulty_ride import broken, go_on, ride, riding, rows, speed_mps, wait_for_row
from tests.simulated.shared import shared


def _stops(run, within_s: float) -> None:
    go_on(run, within_s)
    assert speed_mps(run) < 0.02


@shared(riding)
def test_lost_joint_states_stop_the_robot_until_a_reset() -> None:
    with riding() as run:
        run.stack.faults.inject("messages_lost", "/joint_states>safety_monitor", duration_s=0.3)
        wait_for_row(run, "JOINT_STATES_TIMEOUT", 0.3)
        assert run.safety.safety_state == run.safety.EMERGENCY_STOP
        _stops(run, 1.0)
        go_on(run, 1.0)
        assert "JOINT_STATES_TIMEOUT" in rows(run)  # latched, although messages arrive again
        assert broken(run) == []


@shared(riding)
def test_a_robot_that_ignores_its_limit_is_stopped() -> None:
    with riding() as run:
        run.stack.faults.inject("messages_corrupted", "/safety/velocity_limit:max_linear_velocity=1.5", duration_s=4.0)
        run.stack.faults.inject("imu_silent", duration_s=4.0)
        wait_for_row(run, "OVERSPEED", 3.0)
        assert run.safety.safety_state == run.safety.EMERGENCY_STOP
        _stops(run, 1.0)


@shared(riding)
def test_a_tilted_robot_is_stopped() -> None:
    with riding() as run:
        run.stack.faults.inject("messages_corrupted", "/sensors/imu>safety_monitor:linear_acceleration.x=9.0")
        wait_for_row(run, "TILT", 5.0)
        assert run.safety.safety_state == run.safety.EMERGENCY_STOP
        _stops(run, 1.0)


@shared(riding)
@pytest.mark.parametrize(("charge", "row", "most_mps"), [(0.2, "BATTERY_LOW", 2.0), (0.1, "BATTERY_CRITICAL", 0.6)])
def test_an_empty_battery(charge: float, row: str, most_mps: float) -> None:
    with riding() as run:
        run.world.sim.battery.charge = charge
        wait_for_row(run, row, 3.0)
        go_on(run, 2.0)
        assert speed_mps(run) < most_mps
        run.start_mission("short_hop")
        go_on(run, 0.5)
        assert not run.mission.last_command_accepted
        assert broken(run) == []


@shared(riding)
def test_lost_and_late_commands_brake_the_robot() -> None:
    with riding() as run:
        run.stack.faults.inject("messages_lost", "/cmd_vel", duration_s=2.0)
        _stops(run, 1.9)
        run.stack.faults.inject("messages_late", "/cmd_vel", 0.1, 2.0)
        go_on(run, 3.0)
        assert speed_mps(run) > 0.1
        assert broken(run) == []


@shared(riding)
def test_two_faults_at_once() -> None:
    with riding() as run:
        run.stack.faults.inject("lidar.silent", duration_s=2.0)
        run.stack.faults.inject("process_killed", "navigation_controller")
        wait_for_row(run, "LIDAR_TIMEOUT", 1.0)
        go_on(run, 1.3)
        assert "NODE_DEAD" in rows(run) or run.stack.scheduler.processes["navigation_controller"].running
        assert speed_mps(run) < 0.02
        assert broken(run) == []


@shared(riding)
def test_a_disk_that_takes_no_latch_limits_the_speed() -> None:
    with riding() as run:
        run.stack.faults.inject("disk_broken", duration_s=3.0)
        run.emergency_stop(True)
        wait_for_row(run, "LATCH_NOT_STORED", 1.0)
        assert run.safety.safety_state == run.safety.EMERGENCY_STOP
        go_on(run, 4.0)
        assert "LATCH_NOT_STORED" not in rows(run)  # written by this time
        assert broken(run) == []


@shared(riding)
@pytest.mark.parametrize(("kind", "value"), [("lidar.rain", 25.0), ("lidar.snow", 1.0)])
def test_weather_brings_no_contact_and_no_lost_pose(kind: str, value: float) -> None:
    with riding() as run:
        begun_m = run.notes.moved_m
        run.stack.faults.inject(kind, value=value)
        go_on(run, 5.0)
        assert run.notes.moved_m > begun_m + 0.5
        assert "LOCALIZATION_LOST" not in rows(run)
        assert broken(run) == []


@shared(ride, mission="short_transport")
def test_glare_while_docking_brings_no_contact() -> None:
    with ride(mission="short_transport") as run:
        assert run.stack.scheduler.run_for(12.0, lambda: run.notes.docking.state == "SERVOING")
        run.stack.faults.inject("camera.glare", "front", 300.0)
        go_on(run, 5.0)
        assert broken(run) == []


@shared(ride, mission="short_transport")
def test_a_mission_waits_after_a_loss_of_power() -> None:
    with ride(mission="short_transport") as run:
        go_on(run, 1.0)
        run.stack.faults.inject("power_lost", value=1.0)
        assert run.stack.scheduler.run_for(20.0, lambda: run.mission.state == run.mission.PAUSED)
        assert run.mission.mission_id == "short_transport"
        go_on(run, 2.0)
        assert speed_mps(run) < 0.02
        assert broken(run) == []
