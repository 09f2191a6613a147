"""Stories in fake time: every row of the fault list is raised, acts and clears as specified."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_stack.contract import topics
from robot_stack.contract.frames import JOINTS
from robot_stack.contract.model import SafetyAction, SafetyState
from robot_stack.core.geometry import ZERO_TWIST, Pose2, Twist2
from robot_stack.safety.button import Contact
from robot_stack.safety.inputs import Axis, DriveReading, ImuSample
from robot_stack.safety.monitor import Memory, ResetAnswer
from robot_stack.safety.observation import CAMERAS
from robot_stack.safety.stop_sources import Press
from tests.unit.safety.story import CLOSED, GOOD_AXIS, NOTHING, PARAMS, ROBOT, SWEEP, TICK_S, Story

NORMAL, DEGRADED, AVOIDANCE, EMERGENCY = SafetyState


# --- nothing wrong ---------------------------------------------------------------------------------------------------


def test_everything_well_is_normal_at_the_robots_own_limits() -> None:
    story = Story().healthy().expect(NORMAL, (), linear_mps=1.5, reason="", action=SafetyAction.NONE)
    assert story.verdict.limit.angular_radps == 1.0
    assert story.monitor.details == {}


def test_passenger_is_a_limit_and_no_fault() -> None:
    story = Story().healthy()
    story.carry()
    story.run(0.1).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD", action=SafetyAction.NONE)
    story.carry(False)
    story.run(0.1).expect(NORMAL, (), linear_mps=1.5, reason="")


# --- start-up --------------------------------------------------------------------------------------------------------


def test_a_normal_start_never_latches() -> None:
    story = Story()
    story.communicating = story.wheel_radps = story.imu_tilt_deg = story.pose_m = story.quality = None
    story.beating.clear()
    story.run(3.0).expect(DEGRADED, linear_mps=0.0, action=SafetyAction.STOP)
    story.communicating, story.axes = False, [Axis(False, False, False)] * 8
    story.run(1.0).expect(DEGRADED, linear_mps=0.0)
    story.communicating = True
    story.run(1.0).expect(DEGRADED, linear_mps=0.0)
    assert story.monitor.details["DRIVE_FAULT"] == f"servo off: {', '.join(JOINTS)}"
    story.axes = [Axis(False, True, False)] + [GOOD_AXIS] * 7  # an alarm left from the last ride
    story.run(1.0).expect(DEGRADED, linear_mps=0.0)
    assert story.monitor.details["DRIVE_FAULT"] == "amplifier alarm: fl_drive"
    story.axes = [GOOD_AXIS] * 8
    story.wheel_radps, story.imu_tilt_deg, story.pose_m, story.quality = 0.0, 0.0, (0.0, 0.0), 0.9
    story.beating.update(PARAMS.expected_processes)
    assert not story.monitor.emergency
    story.healthy()


def test_stalls_during_start_up_latch_no_fault() -> None:
    story = Story()
    story.beating.discard("swerve_controller")
    for _ in range(10):
        story.run(1.5)
        story.communicating = story.wheel_radps = None
        story.run(0.3).expect(DEGRADED, linear_mps=0.0)
        story.communicating, story.wheel_radps = True, 0.0
    story.expect(DEGRADED, ("DRIVE_FAULT", "JOINT_STATES_TIMEOUT", "NODE_DEAD"), linear_mps=0.0)
    story.beating.add("swerve_controller")
    story.before(PARAMS.startup_settle_s).expect(DEGRADED, ("DRIVE_FAULT", "JOINT_STATES_TIMEOUT"), linear_mps=0.0)
    story.past().expect(NORMAL, ())
    story.wheel_radps = None
    story.run(0.2).expect(EMERGENCY, ("JOINT_STATES_TIMEOUT",))


@pytest.mark.parametrize("lost", ["navigation_controller", "recorder"])
def test_a_process_that_is_not_critical_holds_no_start_up(lost: str) -> None:
    story = Story(expected_processes=("swerve_controller", "navigation_controller", "recorder"))
    story.beating.discard(lost)
    story.run(3.0).expect(DEGRADED, ("NODE_DEAD",))


@pytest.mark.parametrize("code", ["DRIVE_FAULT", "JOINT_STATES_TIMEOUT"])
def test_drive_that_never_starts_stops_and_then_latches(code: str) -> None:
    story = Story()
    if code == "DRIVE_FAULT":
        story.communicating = None
    else:
        story.wheel_radps = None
    story.before(PARAMS.startup_grace_s).expect(DEGRADED, (code,), linear_mps=0.0, reason=code)
    assert not story.monitor.emergency
    story.past().expect(EMERGENCY, (code,))


def test_servos_that_never_come_on_latch_too() -> None:
    story = Story()
    story.axis(3, servo_on=False).before(PARAMS.startup_grace_s).expect(DEGRADED, ("DRIVE_FAULT",), linear_mps=0.0)
    story.past().expect(EMERGENCY, ("DRIVE_FAULT",))
    assert story.monitor.details["DRIVE_FAULT"] == "servo off: fr_steer"


# --- ESTOP_PRESSED ---------------------------------------------------------------------------------------------------


def test_estop_acts_in_the_same_step() -> None:
    story = Story().healthy().estop(True)
    story.expect(EMERGENCY, ("ESTOP_PRESSED",), reason="ESTOP_PRESSED", action=SafetyAction.EMERGENCY_STOP)


def test_a_short_press_between_two_steps_counts() -> None:
    story = Story().healthy()
    story.monitor.observation.emergency_stop(True, story.now_s)
    story.monitor.observation.emergency_stop(False, story.now_s)
    story.step().expect(EMERGENCY, ("ESTOP_PRESSED",))


def test_release_needs_both_source_release_and_reset() -> None:
    story = Story().healthy().estop(True).run(1.0)
    refused = story.reset()
    assert not refused.success
    assert "ESTOP_PRESSED: pressed by touch_ui" in refused.message
    story.estop(False).run(10.0).expect(EMERGENCY, ("ESTOP_PRESSED",))
    assert story.reset() == ResetAnswer(True, "released: ESTOP_PRESSED")
    story.expect(NORMAL, ())
    story.run(1.0).expect(NORMAL, ())


# --- DRIVE_FAULT -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "detail"),
    [
        ({"amp_alarm": True}, "amplifier alarm: rl_drive"),
        ({"following_error": True}, "following error: rl_drive"),
    ],
)
def test_an_alarm_stops_at_once_and_stays_until_reset(wrong: dict[str, bool], detail: str) -> None:
    story = Story().healthy().axis(4, **wrong)
    story.tick().expect(EMERGENCY, ("DRIVE_FAULT",), reason="DRIVE_FAULT")
    assert story.monitor.details["DRIVE_FAULT"] == detail
    story.run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: DRIVE_FAULT: {detail}")
    story.axes[4] = GOOD_AXIS
    story.run(5.0).expect(EMERGENCY, ("DRIVE_FAULT",))
    assert story.reset() == ResetAnswer(True, "released: DRIVE_FAULT")
    story.expect(NORMAL, ())


@pytest.mark.parametrize("how", ["no bus", "engine gone", "engine frozen"])
def test_an_engine_that_falls_silent_latches(how: str) -> None:
    story = Story().healthy()
    if how == "no bus":
        story.communicating = False
    else:
        story.communicating = None
    frozen = DriveReading(True, story.ticks, tuple(story.axes))
    for _ in range(9):
        if how == "engine frozen":
            story.monitor.observation.engine(frozen, story.now_s)
        story.tick().expect(NORMAL)
    story.past().expect(EMERGENCY, ("DRIVE_FAULT",))
    assert story.monitor.details["DRIVE_FAULT"] == "the motion engine does not communicate"
    assert not story.reset().success
    story.communicating = True
    story.run(1.0)
    assert story.reset().success
    story.run(0.5).expect(NORMAL, ())


def test_uncommanded_servo_off_latches() -> None:
    story = Story().healthy().axis(7, servo_on=False)
    story.tick().before(PARAMS.drive_servo_off_s).expect(NORMAL)
    story.past().expect(EMERGENCY, ("DRIVE_FAULT",))
    assert story.monitor.details["DRIVE_FAULT"] == "servo off: rr_steer"


def test_servos_that_an_emergency_stop_switches_off_are_no_fault() -> None:
    story = Story().healthy()
    story.axes = [replace(GOOD_AXIS, servo_on=False)] * 8  # the engine reports before the message arrives
    story.before(PARAMS.drive_servo_off_s).expect(NORMAL).estop(True).run(5.0).expect(EMERGENCY, ("ESTOP_PRESSED",))
    story.estop(False).run(1.0)
    assert story.reset().success
    story.expect(DEGRADED, ("DRIVE_FAULT",), linear_mps=0.0)
    story.before(PARAMS.drive_servo_on_timeout_s).expect(DEGRADED, ("DRIVE_FAULT",), linear_mps=0.0)
    story.axes = [GOOD_AXIS] * 8
    story.tick().expect(NORMAL, ())


def test_servos_that_do_not_come_back_after_a_release_latch() -> None:
    story = Story().healthy().estop(True)
    story.axes[0] = replace(GOOD_AXIS, servo_on=False)
    story.estop(False).run(1.0)
    assert story.reset().success
    story.before(PARAMS.drive_servo_on_timeout_s).expect(DEGRADED, ("DRIVE_FAULT",), linear_mps=0.0)
    story.past().expect(EMERGENCY, ("DRIVE_FAULT",))


def test_an_alarm_while_the_servos_come_back_is_a_fault_at_once() -> None:
    story = Story().healthy().estop(True)
    story.axes[0] = replace(GOOD_AXIS, servo_on=False)
    story.estop(False).run(1.0)
    assert story.reset().success
    story.run(0.1).expect(DEGRADED).axis(1, amp_alarm=True).tick().expect(EMERGENCY, ("DRIVE_FAULT",))


# --- JOINT_STATES_TIMEOUT --------------------------------------------------------------------------------------------


def test_joint_states_that_stop_latch_after_their_limit() -> None:
    story = Story().healthy()
    story.wheel_radps = None
    story.before(0.1).expect(NORMAL, ())
    story.past().expect(EMERGENCY, ("JOINT_STATES_TIMEOUT",), reason="JOINT_STATES_TIMEOUT")
    story.run(1.0)
    refused = story.reset().message
    assert "JOINT_STATES_TIMEOUT: /joint_states: silent for" in refused
    assert "is not at standstill" in refused
    story.wheel_radps = 0.0
    story.run(PARAMS.standstill_hold_s + 2 * TICK_S).expect(EMERGENCY)
    assert story.reset() == ResetAnswer(True, "released: JOINT_STATES_TIMEOUT")
    story.expect(NORMAL, ())


def test_timeout_shorter_than_a_tick_latches() -> None:
    """The whole machine pauses. The first messages afterwards are fresh joint states."""
    story = Story().healthy()
    story.tick(0.09).expect(NORMAL, ())
    story.tick(0.11).expect(EMERGENCY)
    assert "JOINT_STATES_TIMEOUT" in story.verdict.faults


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_joint_states_that_are_no_numbers_are_none(bad: float) -> None:
    story = Story().healthy()
    story.wheel_radps = bad
    story.before(0.1).expect(NORMAL).past().expect(EMERGENCY, ("JOINT_STATES_TIMEOUT",))
    assert story.monitor.details["JOINT_STATES_TIMEOUT"] == "/joint_states: fl_drive is not finite"


# --- IMU_TIMEOUT -----------------------------------------------------------------------------------------------------


def _silent(story: Story) -> None:
    story.imu_tilt_deg = None


def _frozen(story: Story) -> None:
    story.imu_frozen = True


def _not_a_number(story: Story) -> None:
    story.imu_tilt_deg = math.nan


@pytest.mark.parametrize(("break_it", "why"), [(_silent, "silent"), (_frozen, "frozen"), (_not_a_number, "not finite")])
def test_a_missing_imu_limits_and_clears_after_a_second(break_it: Callable[[Story], None], why: str) -> None:
    story = Story().healthy()
    story.tick()
    break_it(story)
    # A frozen sensor's first sample may still be new.
    story.before(0.1).expect(NORMAL).past()
    story.expect(DEGRADED, ("IMU_TIMEOUT",), linear_mps=0.5, reason="IMU_TIMEOUT", action=SafetyAction.LIMIT)
    assert why in story.monitor.details["IMU_TIMEOUT"]
    story.run(2.0).expect(DEGRADED, ("IMU_TIMEOUT",))
    story.imu_tilt_deg, story.imu_frozen = 0.0, False
    story.before(1.0).expect(DEGRADED, ("IMU_TIMEOUT",), linear_mps=0.5)
    story.past().expect(NORMAL, (), linear_mps=1.5)


def test_an_imu_that_stutters_never_clears() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = None
    story.run(0.2).expect(DEGRADED, ("IMU_TIMEOUT",))
    for _ in range(5):
        story.imu_tilt_deg = 0.0
        story.run(0.9).expect(DEGRADED, ("IMU_TIMEOUT",))
        story.imu_tilt_deg = None
        story.run(0.2).expect(DEGRADED, ("IMU_TIMEOUT",))


# --- TILT, SLOPE -----------------------------------------------------------------------------------------------------

SETTLED_S = 6.0 * PARAMS.attitude_time_constant_s


def test_slope_limits_then_stops_then_tips() -> None:
    story = Story().healthy()
    story.request = Twist2(-0.5, 0.0, 0.0)  # the robot faces downhill: reversing is uphill
    story.imu_tilt_deg = 4.9
    story.run(SETTLED_S).expect(NORMAL, ())
    story.imu_tilt_deg = 5.1
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.3, reason="SLOPE", action=SafetyAction.LIMIT)
    story.imu_tilt_deg = 4.6  # within the hysteresis
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.3)
    story.imu_tilt_deg = 11.4
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.3)
    story.imu_tilt_deg = 11.6
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.0, action=SafetyAction.STOP)
    story.imu_tilt_deg = 11.1
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.0)
    story.imu_tilt_deg = 10.9
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.3)
    story.imu_tilt_deg = 4.4
    story.run(SETTLED_S).expect(NORMAL, (), linear_mps=1.5)
    story.imu_tilt_deg = 15.2
    story.run(SETTLED_S).expect(EMERGENCY, ("TILT", "SLOPE"), reason="TILT,SLOPE")


def test_a_robot_stopped_on_a_ramp_of_10_deg_may_go_on_up_or_down() -> None:
    """Whatever stopped it, and with an inclination error of up to 1 deg plus noise."""
    for ramp_deg in (9.0, 10.0, 11.0):
        story = Story().healthy()
        story.imu_tilt_deg = ramp_deg
        story.run(SETTLED_S).estop(True).run(1.0).expect(EMERGENCY, ("ESTOP_PRESSED", "SLOPE"))
        story.estop(False).run(1.0)
        assert story.reset() == ResetAnswer(True, "released: ESTOP_PRESSED")
        story.expect(DEGRADED, ("SLOPE",), linear_mps=0.3, action=SafetyAction.LIMIT)
        for uphill in (-0.3, 0.3):
            story.request = story.driven = Twist2(uphill, 0.0, 0.0)
            for k in range(300):
                story.imu_tilt_deg = ramp_deg + (0.4 if k % 2 else -0.4)
                story.tick().expect(DEGRADED, ("SLOPE",), linear_mps=0.3, action=SafetyAction.LIMIT)


def test_above_the_limit_a_released_robot_may_only_go_downhill() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = 12.5
    story.run(SETTLED_S).estop(True).run(1.0).estop(False).run(1.0)
    assert story.reset().success
    story.expect(DEGRADED, ("SLOPE",), linear_mps=0.2, action=SafetyAction.LIMIT)  # no motion requested yet
    story.request = Twist2(0.5, 0.0, 0.0)
    story.run(1.0).expect(DEGRADED, ("SLOPE",), linear_mps=0.2, action=SafetyAction.LIMIT)
    assert story.verdict.limit.angular_radps == 0.05
    assert story.monitor.details["SLOPE"] == "inclination 12.5 deg, downhill"
    story.driven = Twist2(0.2, 0.0, 0.0)
    story.run(1.0).expect(DEGRADED, ("SLOPE",), linear_mps=0.2)
    story.request = Twist2(-0.5, 0.0, 0.0)
    story.tick().expect(DEGRADED, ("SLOPE",), linear_mps=0.0, action=SafetyAction.STOP)
    assert story.monitor.details["SLOPE"] == "inclination 12.5 deg, the motion is not downhill"
    story.driven = ZERO_TWIST
    story.run(60.0).expect(DEGRADED, ("SLOPE",), linear_mps=0.0)
    story.request = Twist2(0.1, 0.0, 0.0)
    story.tick().expect(DEGRADED, ("SLOPE",), linear_mps=0.2)


def test_rejected_uphill_motion_may_be_planned_again_later() -> None:
    """Navigation requests nothing while the limit is zero, so a limit above zero must return for the way down."""
    story = Story().healthy()
    story.imu_tilt_deg = 12.5
    story.request = Twist2(-0.3, 0.0, 0.0)
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.0)
    story.request = ZERO_TWIST
    story.before(PARAMS.descent.ask_again_s).expect(DEGRADED, ("SLOPE",), linear_mps=0.0, action=SafetyAction.STOP)
    story.past().expect(DEGRADED, ("SLOPE",), linear_mps=0.2, action=SafetyAction.LIMIT)
    story.request = Twist2(0.2, 0.0, 0.0)
    story.run(1.0).expect(DEGRADED, ("SLOPE",), linear_mps=0.2)


def test_tilt_stays_until_level_again_and_reset() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = 15.2
    story.run(SETTLED_S).expect(EMERGENCY, ("TILT", "SLOPE"))
    story.imu_tilt_deg = 13.5
    story.run(SETTLED_S)
    assert story.reset().message == "refused: TILT: inclination 13.5 deg"
    story.imu_tilt_deg = 0.0
    story.run(SETTLED_S).expect(EMERGENCY, ("TILT",))
    assert story.reset() == ResetAnswer(True, "released: TILT")
    story.expect(NORMAL, ())


def test_tilt_without_data_is_not_released() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = 16.0
    story.run(SETTLED_S).expect(EMERGENCY, ("TILT", "SLOPE"))
    story.imu_tilt_deg = None
    story.run(2.0).expect(EMERGENCY, ("TILT", "IMU_TIMEOUT", "SLOPE"))
    assert story.reset() == ResetAnswer(False, "refused: TILT: cannot be evaluated")


def test_a_slope_outlives_the_imu_that_saw_it() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = 12.0
    story.request = Twist2(0.2, 0.0, 0.0)
    story.run(SETTLED_S).expect(DEGRADED, ("SLOPE",), linear_mps=0.2)
    story.imu_tilt_deg = None  # the downhill direction is unknown
    story.run(5.0).expect(DEGRADED, ("IMU_TIMEOUT", "SLOPE"), linear_mps=0.0, reason="SLOPE")
    story.imu_tilt_deg = 0.0
    story.run(PARAMS.attitude_settle_s - TICK_S).expect(DEGRADED, ("IMU_TIMEOUT", "SLOPE"))
    story.run(1.5).expect(NORMAL, ())


def test_a_robot_that_loses_its_imu_on_a_ramp_of_10_deg_is_not_trapped() -> None:
    story = Story().healthy()
    story.imu_tilt_deg = 10.0
    story.run(SETTLED_S)
    story.imu_tilt_deg = None
    story.run(5.0).expect(DEGRADED, ("IMU_TIMEOUT", "SLOPE"), linear_mps=0.3, action=SafetyAction.LIMIT)


# --- LOCALIZATION_LOST -----------------------------------------------------------------------------------------------


def test_a_bad_quality_stops_until_it_has_been_good_for_two_seconds() -> None:
    story = Story().healthy()
    story.quality = 0.30
    story.run(1.0).expect(NORMAL)
    story.quality = 0.29
    story.tick().expect(DEGRADED, ("LOCALIZATION_LOST",), linear_mps=0.0, reason="LOCALIZATION_LOST")
    story.quality = 0.50
    story.run(5.0).expect(DEGRADED, ("LOCALIZATION_LOST",))
    story.quality = 0.51
    story.before(2.0).expect(DEGRADED, ("LOCALIZATION_LOST",))
    story.past().expect(NORMAL, ())


@pytest.mark.parametrize("quality", [None, math.nan, -0.1, 1.1])
def test_a_quality_that_is_none_stops(quality: float | None) -> None:
    story = Story().healthy()
    story.quality = quality
    story.before(0.5).expect(NORMAL).past().expect(DEGRADED, ("LOCALIZATION_LOST",), linear_mps=0.0)


@pytest.mark.parametrize("pose", [None, (math.nan, 0.0), (0.0, math.inf)])
def test_a_pose_that_is_none_stops(pose: tuple[float, float] | None) -> None:
    story = Story().healthy()
    story.pose_m = pose
    story.before(0.5).expect(NORMAL).past().expect(DEGRADED, ("LOCALIZATION_LOST",), linear_mps=0.0)


def test_a_jump_stops_for_two_seconds() -> None:
    story = Story().healthy()
    story.pose_m = (2.0, 2.0)
    story.run(0.1).expect(NORMAL)
    story.pose_m = (2.0, 3.01)
    story.tick().expect(DEGRADED, ("LOCALIZATION_LOST",), linear_mps=0.0)
    assert story.monitor.details["LOCALIZATION_LOST"] == "/current_pose jumped by 1.01 m"
    story.before(2.0).expect(DEGRADED, ("LOCALIZATION_LOST",)).past().expect(NORMAL, ())


# --- NODE_DEAD -------------------------------------------------------------------------------------------------------

WATCHED = ("swerve_controller", "navigation_controller", "recorder")


@pytest.mark.parametrize(
    ("dead", "action", "linear_mps"),
    [
        ({"recorder"}, SafetyAction.WARN, 1.5),
        ({"navigation_controller"}, SafetyAction.LIMIT, 0.5),
        ({"swerve_controller"}, SafetyAction.STOP, 0.0),
        ({"recorder", "navigation_controller"}, SafetyAction.LIMIT, 0.5),
        (set(WATCHED), SafetyAction.STOP, 0.0),
    ],
)
def test_a_dead_process_acts_by_its_criticality(dead: set[str], action: SafetyAction, linear_mps: float) -> None:
    story = Story(expected_processes=WATCHED).healthy()
    story.beating -= dead
    story.before(1.0).expect(NORMAL).past().expect(DEGRADED, ("NODE_DEAD",), linear_mps=linear_mps, action=action)
    assert story.monitor.details["NODE_DEAD"] == f"no heartbeat of {', '.join(n for n in WATCHED if n in dead)}"
    assert story.verdict.limit.codes == (() if action is SafetyAction.WARN else ("NODE_DEAD",))
    story.beating |= dead
    story.tick().expect(NORMAL, ())


def test_a_second_death_makes_it_worse_and_its_return_better() -> None:
    story = Story(expected_processes=WATCHED).healthy()
    story.beating -= {"navigation_controller"}
    story.run(1.5).expect(DEGRADED, linear_mps=0.5)
    story.beating -= {"swerve_controller"}
    story.run(1.5).expect(DEGRADED, linear_mps=0.0)
    story.beating |= {"swerve_controller"}
    story.tick().expect(DEGRADED, ("NODE_DEAD",), linear_mps=0.5)


def test_heartbeats_of_strangers_are_no_concern() -> None:
    story = Story().healthy()
    story.monitor.observation.heartbeat("somebody", story.now_s)
    story.run(2.0).expect(NORMAL, ())


# --- cameras ---------------------------------------------------------------------------------------------------------

FRONT, REAR = "/sensors/camera/front/camera_info", "/sensors/camera/rear/camera_info"


@pytest.mark.parametrize("state", ["SEARCH", "SERVOING", "FINE_ALIGN"])
@pytest.mark.parametrize("silent", [FRONT, REAR])
def test_camera_timeout_while_docking_is_reported(state: str, silent: str) -> None:
    story = Story().healthy()
    story.docking, story.cameras = state, [FRONT, REAR]
    story.run(2.0).expect(NORMAL, ())
    story.cameras = [camera for camera in (FRONT, REAR) if camera != silent]
    story.before(0.5).expect(NORMAL, ())
    story.past().expect(DEGRADED, ["CAMERA_TIMEOUT"], action=SafetyAction.WARN)
    assert story.monitor.details["CAMERA_TIMEOUT"] == f"{silent}: silent for 0.51 s"
    story.run(5.0).expect(DEGRADED, ["CAMERA_TIMEOUT"])
    story.cameras = [FRONT, REAR]
    story.tick().expect(NORMAL, ())


@pytest.mark.parametrize("state", ["IDLE", "APPROACH", "DOCKED", "FAILED"])
def test_cameras_are_missed_only_while_they_guide(state: str) -> None:
    story = Story().healthy()
    story.docking = state
    story.run(3.0).expect(NORMAL, ())
    story.docking = "SEARCH"
    story.run(2.0).expect(DEGRADED, ["CAMERA_TIMEOUT"])
    story.docking = state
    story.tick().expect(NORMAL, ())


def test_docking_that_fell_silent_misses_no_camera() -> None:
    story = Story().healthy()
    story.docking = "SEARCH"
    story.run(1.0).expect(DEGRADED, ["CAMERA_TIMEOUT"])
    story.docking = None
    story.before(0.5).expect(DEGRADED, ["CAMERA_TIMEOUT"])
    story.past().expect(NORMAL, ())


# --- battery ---------------------------------------------------------------------------------------------------------


def test_battery_warns_then_limits_and_clears_once_charged() -> None:
    story = Story().healthy()
    story.battery = 0.30
    story.run(0.1).expect(NORMAL)
    story.battery = 0.29
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW",), linear_mps=1.5, reason="", action=SafetyAction.WARN)
    story.battery = 0.15
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW",))
    story.battery = 0.149
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW", "BATTERY_CRITICAL"), linear_mps=0.5, reason="BATTERY_CRITICAL")
    story.battery = 0.179
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW", "BATTERY_CRITICAL"), linear_mps=0.5)
    story.battery = 0.181
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW",), linear_mps=1.5)
    story.battery = 0.329
    story.run(0.1).expect(DEGRADED, ("BATTERY_LOW",))
    story.battery = 0.331
    story.run(0.1).expect(NORMAL, ())


@pytest.mark.parametrize("battery", [None, math.nan, -0.01, 1.01])
def test_an_unknown_charge_counts_as_low(battery: float | None) -> None:
    story = Story().healthy()
    story.battery = battery
    story.before(5.0).expect(NORMAL).past().expect(DEGRADED, ("BATTERY_LOW",), linear_mps=1.5)


def test_a_critical_charge_outlives_the_battery_message() -> None:
    story = Story().healthy()
    story.battery = 0.1
    story.run(0.1)
    story.battery = None
    story.run(6.0).expect(DEGRADED, ("BATTERY_LOW", "BATTERY_CRITICAL"), linear_mps=0.5)


# --- several at once -------------------------------------------------------------------------------------------------


def test_smallest_limit_applies_and_names_its_reason() -> None:
    story = Story().healthy()
    story.carry()
    story.battery, story.imu_tilt_deg = 0.1, None
    story.run(1.0).expect(DEGRADED, linear_mps=0.5, reason="IMU_TIMEOUT,BATTERY_CRITICAL")


def test_an_emergency_keeps_everything_else_in_sight() -> None:
    story = Story().healthy()
    story.battery = 0.2
    story.estop(True).run(0.1).expect(EMERGENCY, ("ESTOP_PRESSED", "BATTERY_LOW"), reason="ESTOP_PRESSED")


# --- restart of the monitor ------------------------------------------------------------------------------------------


def test_a_latched_emergency_survives_a_crash() -> None:
    story = Story().healthy().estop(True).restarted()
    story.expect(EMERGENCY).run(5.0).expect(EMERGENCY, ("ESTOP_PRESSED",))
    assert story.monitor.details == {"ESTOP_PRESSED": "pressed by touch_ui"}
    assert story.reset().message == (
        "refused: /emergency_stop has not been released: no false since the monitor's start; "
        "ESTOP_PRESSED: pressed by touch_ui"
    )
    story.estop(False).run(1.0)
    assert story.reset().success
    story.expect(NORMAL, ())


def test_a_latched_drive_fault_survives_a_crash_and_needs_no_release() -> None:
    story = Story().healthy().axis(2, amp_alarm=True).tick().expect(EMERGENCY).restarted()
    assert story.reset().message.endswith("DRIVE_FAULT: the motion engine does not communicate")
    story.run(5.0).expect(EMERGENCY, ("DRIVE_FAULT",))
    assert story.reset() == ResetAnswer(True, "released: DRIVE_FAULT")


def test_a_passenger_survives_a_crash() -> None:
    story = Story(memory=Memory(passenger=True))
    story.latch = CLOSED
    story.run(5.0).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD")
    assert story.monitor.memory == Memory((), True)


def test_a_latch_of_a_row_that_is_switched_off_is_not_lost() -> None:
    rows = tuple(code for code in PARAMS.rows if code != "TILT")
    story = Story(memory=Memory(("TILT",)), rows=rows).run(5.0)
    story.expect(EMERGENCY, ("ESTOP_PRESSED",))


def test_memory_is_empty_without_a_latched_fault() -> None:
    story = Story().healthy()
    assert story.monitor.memory == Memory()
    story.estop(True).axis(0, amp_alarm=True).tick()
    assert story.monitor.memory == Memory(("ESTOP_PRESSED", "DRIVE_FAULT"), False, (Press("touch_ui", 1),))


# --- time ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("to_s", [0.0, math.nan, 1e9])
def test_time_that_jumps_stops_the_robot(to_s: float) -> None:
    story = Story().healthy()
    verdict = story.monitor.step(to_s)
    assert verdict.limit.linear_mps == 0.0
    assert {"DRIVE_FAULT", "JOINT_STATES_TIMEOUT", "LOCALIZATION_LOST", "IMU_TIMEOUT"} <= set(verdict.faults)
    assert "NODE_DEAD" in verdict.faults
    assert story.monitor.emergency


def test_after_time_ran_backwards_both_keys_still_work() -> None:
    story = Story().healthy()
    story.now_s = 0.0
    story.step().expect(EMERGENCY)
    # The button's reports also lie in the future, so its process counts as dead.
    story.run(5.0).expect(EMERGENCY, ("ESTOP_PRESSED", "DRIVE_FAULT", "JOINT_STATES_TIMEOUT"))
    story.estop(False).run(1.0)
    assert story.reset() == ResetAnswer(True, "released: ESTOP_PRESSED, DRIVE_FAULT, JOINT_STATES_TIMEOUT")
    story.expect(NORMAL, ())


def test_an_acceleration_is_no_slope() -> None:
    """1.5 m/s2 forward looks like 8.7 deg to an accelerometer; the wheel acceleration corrects this."""
    story = Story().healthy()
    story.imu_tilt_deg = None
    speed_mps = 0.0
    for _ in range(round(1.0 / TICK_S)):
        speed_mps += 1.5 * TICK_S
        story.wheel_radps = speed_mps / 0.0825
        story.monitor.observation.imu(ImuSample(1.5, 0.0, 9.81, 1e-9 * story.ticks, 0.0, 0.0), story.now_s)
        story.tick().expect(NORMAL, ())


# --- LIDAR_TIMEOUT, OBSTACLES_TIMEOUT --------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["silent", "frozen", "covered", "not finite"])
def test_frozen_lidar_stops_the_robot(how: str) -> None:
    story = Story().healthy()
    if how == "frozen":
        story.sweep_frozen = True
        story.run(0.1)
    elif how == "silent":
        story.sweep = None
    else:
        story.sweep = np.full_like(SWEEP, 0.1 if how == "covered" else math.nan)
    story.run(0.4).expect(NORMAL, ())
    story.run(0.2).expect(DEGRADED, ("LIDAR_TIMEOUT",), linear_mps=0.0, reason="LIDAR_TIMEOUT")
    story.sweep, story.sweep_frozen = SWEEP, False
    story.run(0.9).expect(DEGRADED, ("LIDAR_TIMEOUT",)).run(0.25).expect(NORMAL, ())


@pytest.mark.parametrize("how", ["silent", "frozen", "covered"])
def test_frozen_overhead_lidar_stops_the_robot(how: str) -> None:
    story = Story().healthy()
    if how == "frozen":
        story.overhead_frozen = True
        story.run(0.1)
    else:
        story.overhead = None if how == "silent" else np.full_like(SWEEP, 0.2)
    story.run(0.2)
    assert "LIDAR_TIMEOUT" not in story.verdict.faults
    story.run(0.2)
    assert story.verdict.faults == ("LIDAR_TIMEOUT",)
    assert story.verdict.limit.linear_mps == 0.0
    story.overhead, story.overhead_frozen = SWEEP, False
    story.run(0.9)
    assert "LIDAR_TIMEOUT" in story.verdict.faults
    story.run(0.25)
    assert "LIDAR_TIMEOUT" not in story.verdict.faults


@pytest.mark.parametrize("how", ["silent", "not finite"])
def test_missing_obstacles_stop_the_robot(how: str) -> None:
    story = Story().healthy()
    story.obstacles = None if how == "silent" else np.full((5, 3), math.nan, np.float32)
    story.run(0.24).expect(NORMAL, ())
    assert story.monitor.nearest_obstacle_m == math.inf
    story.run(0.12).expect(DEGRADED, ("OBSTACLES_TIMEOUT",), linear_mps=0.0, reason="OBSTACLES_TIMEOUT")
    assert math.isnan(story.monitor.nearest_obstacle_m)
    story.obstacles = NOTHING
    story.run(0.9).expect(DEGRADED).run(0.25).expect(NORMAL, ())
    assert story.monitor.nearest_obstacle_m == math.inf


def test_surroundings_never_received_stop_the_robot() -> None:
    story = Story()
    story.sweep = story.overhead = story.obstacles = None
    story.run(3.0).expect(DEGRADED, ("LIDAR_TIMEOUT", "OBSTACLES_TIMEOUT"), linear_mps=0.0)
    assert story.monitor.details["LIDAR_TIMEOUT"] == (
        "/sensors/lidar/points: never received, /sensors/overhead_lidar/points: never received"
    )
    assert story.monitor.details["OBSTACLES_TIMEOUT"] == "/perception/obstacles: never received"


def test_clocks_that_run_back_make_the_surroundings_old() -> None:
    story = Story().healthy()
    story.now_s -= 50.0
    story.step()
    assert {"LIDAR_TIMEOUT", "OBSTACLES_TIMEOUT"} <= set(story.verdict.faults)


# --- COLLISION_IMMINENT, OBSTACLE_NEAR -------------------------------------------------------------------------------

AHEAD, BACK = Twist2(0.4, 0.0, 0.0), Twist2(-0.4, 0.0, 0.0)


def _wall(x_m: float, width_m: float = 2.0) -> NDArray[np.float32]:
    ys = np.arange(-0.5 * width_m, 0.5 * width_m + 0.01, 0.05)
    return np.array([(x_m, y, z) for y in ys for z in (0.3, 1.0)], np.float32)


def test_the_nearer_the_slower_and_then_a_stop() -> None:
    story = Story().healthy()
    story.driven, story.obstacles = AHEAD, _wall(2.5)
    story.run(0.1).expect(NORMAL, ())
    assert story.monitor.nearest_obstacle_m == pytest.approx(2.0)
    story.obstacles = _wall(1.31)
    story.run(0.1).expect(AVOIDANCE, ("OBSTACLE_NEAR",), reason="OBSTACLE_NEAR")
    assert story.verdict.limit.linear_mps == pytest.approx(0.32)
    story.obstacles = _wall(0.9)
    story.run(0.1).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)
    assert story.verdict.limit.codes == ("COLLISION_IMMINENT",)
    assert story.monitor.details["COLLISION_IMMINENT"] == "collision in 0.9 s"


def test_held_robot_stays_held_until_the_request_changes() -> None:
    """The robot does not stop and go in front of a wall; another direction is free after half a second."""
    story = Story().healthy()
    story.driven, story.request, story.obstacles = ZERO_TWIST, AHEAD, _wall(0.6)
    story.run(3.0).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)
    story.request = BACK
    story.before(0.5).expect(AVOIDANCE, ("COLLISION_IMMINENT",), linear_mps=0.0).past().expect(NORMAL, ())
    story.driven = BACK
    story.run(0.5).expect(NORMAL, ())


@pytest.mark.parametrize(
    "twist", [Twist2(-0.4, 0.0, 0.0), Twist2(0.0, 0.4, 0.0), Twist2(0.0, -0.4, 0.0), Twist2(-0.2, 0.2, 0.0)]
)
def test_before_a_wall_every_way_that_does_not_lead_into_it_is_free(twist: Twist2) -> None:
    story = Story().healthy()
    story.driven, story.obstacles = twist, _wall(0.58, 3.0)
    story.run(0.3).expect(NORMAL, ())


def test_a_robot_that_stands_near_something_is_no_collision() -> None:
    story = Story().healthy()
    story.obstacles = _wall(0.53)
    story.run(1.0).expect(NORMAL, ())
    assert story.monitor.nearest_obstacle_m == pytest.approx(0.03)


def test_a_gate_of_1_3_m_can_be_passed() -> None:
    story = Story().healthy()
    story.driven = AHEAD
    for x_m in np.arange(3.0, -1.5, -0.05):
        posts = [
            (x_m + dx, side * (0.65 + dy), z)
            for side in (1, -1)
            for dx in (0.0, 0.2)
            for dy in (0, 0.1)
            for z in (1.0, 0.3)
        ]
        story.obstacles = np.array(posts, np.float32)
        story.run(0.05).expect(NORMAL, ())
    assert story.monitor.nearest_obstacle_m < 3.0


def test_a_robot_that_rolls_without_a_command_is_judged_too() -> None:
    story = Story().healthy()
    story.obstacles = _wall(0.7)
    story.wheel_radps = 0.5 / ROBOT.wheel_radius_m
    story.run(0.1).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)
    story.wheel_radps = 0.9 * PARAMS.standstill_mps / ROBOT.wheel_radius_m  # within encoder noise
    story.run(1.0).expect(NORMAL, ())


def test_a_silent_drive_is_judged_by_the_command_it_was_given() -> None:
    story = Story().healthy()
    story.driven, story.request, story.obstacles = None, AHEAD, _wall(0.8)
    story.run(0.3).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)


def test_the_wheelchair_is_part_of_the_footprint() -> None:
    story = Story().healthy()
    story.driven, story.obstacles = AHEAD, _wall(3.0)
    story.run(0.1).expect(NORMAL, ())
    story.carry()
    story.obstacles = _wall(2.21)
    story.run(0.2).expect(AVOIDANCE, ("OBSTACLE_NEAR",), linear_mps=pytest.approx(0.32))
    story.obstacles = _wall(1.5)
    story.run(0.2).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)


def test_unknown_obstacles_neither_raise_nor_clear_a_collision() -> None:
    story = Story().healthy()
    story.driven, story.obstacles = AHEAD, _wall(0.6)
    story.run(0.1).expect(AVOIDANCE)
    story.obstacles = None
    story.run(2.0).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR", "OBSTACLES_TIMEOUT"), linear_mps=0.0)


# --- unseen space ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("x_m", "linear_mps"), [(0.52, 0.3), (1.55, 0.82), (5.0, 1.5)])
def test_speed_limit_stops_within_the_seen_space(x_m: float, linear_mps: float) -> None:
    """Unseen space limits the speed but is no fault, since it exists at every start."""
    story = Story().healthy()
    story.unseen = np.array([(x_m, y, 0.0) for y in np.arange(-0.5, 0.51, 0.05)], np.float32)
    story.run(0.3).expect(NORMAL, (), linear_mps=1.5, reason="")
    story.request = AHEAD
    reason = "WAY_UNSEEN" if linear_mps < 1.5 else ""
    story.run(0.1).expect(NORMAL, (), linear_mps=pytest.approx(linear_mps), reason=reason)
    story.driven = AHEAD
    story.run(0.1).expect(NORMAL, (), linear_mps=pytest.approx(linear_mps), reason=reason)
    story.request = story.driven = BACK
    story.run(0.1).expect(NORMAL, (), linear_mps=1.5, reason="")


def test_robot_with_passenger_stops_at_the_end_of_known_ground() -> None:
    """This is no fault either. Reverse stays possible, and without a passenger the robot still creeps forward."""
    story = Story().healthy()
    story.no_ground = np.array([(1.54, y, 0.0) for y in np.arange(-0.5, 0.51, 0.05)], np.float32)
    story.request = story.driven = AHEAD
    story.run(0.1).expect(NORMAL, (), linear_mps=1.5)
    story.carry()
    story.run(0.1).expect(NORMAL, (), linear_mps=0.0, reason="WAY_UNSEEN")
    story.driven = ZERO_TWIST
    story.run(0.1).expect(NORMAL, (), linear_mps=0.0, reason="WAY_UNSEEN")
    story.request = story.driven = BACK
    story.run(0.1).expect(NORMAL, (), linear_mps=1.0, reason="PASSENGER_ONBOARD")
    story.request = story.driven = Twist2(0.5, 0.0, 0.0)
    story.no_ground[:, 0] = 1.8
    story.run(0.1).expect(NORMAL, (), linear_mps=pytest.approx(0.24), reason="WAY_UNSEEN")


def test_ground_is_unknown_without_a_message_with_a_passenger() -> None:
    story = Story().healthy()
    story.carry().no_ground = None
    story.request = story.driven = AHEAD
    story.run(0.6).expect(NORMAL, (), linear_mps=0.0, reason="WAY_UNSEEN")
    story.request, story.driven = AHEAD, None
    story.run(0.6).expect(NORMAL, (), linear_mps=0.0, reason="WAY_UNSEEN")


def test_the_turn_is_limited_as_the_farthest_corner_moves() -> None:
    story = Story().healthy()
    story.unseen = np.array([(0.5, 0.42, 0.0)], np.float32)
    story.request = story.driven = Twist2(0.0, 0.0, 0.5)
    story.run(0.1).expect(NORMAL, (), linear_mps=pytest.approx(0.3), reason="WAY_UNSEEN")
    assert story.verdict.limit.angular_radps == pytest.approx(0.3 / math.hypot(0.5, 0.35))


def test_without_unseen_cloud_the_robot_creeps() -> None:
    story = Story().healthy()
    story.request = story.driven = AHEAD
    story.run(0.3).expect(NORMAL, (), linear_mps=1.5)
    story.unseen = None
    story.run(0.6).expect(NORMAL, (), linear_mps=pytest.approx(0.3), reason="WAY_UNSEEN")


def test_robot_without_surroundings_rows_is_not_slowed() -> None:
    story = Story(rows=("ESTOP_PRESSED", "OBSTACLE_NEAR"))
    story.unseen = None
    story.request = story.driven = AHEAD
    story.run(1.0).expect(NORMAL, (), linear_mps=1.5)


# --- computer and links ----------------------------------------------------------------------------------------------

LINKED = ("swerve_controller", "ehmi_bridge", "touch_ui")


@pytest.mark.parametrize(
    ("code", "usage", "temperature_c", "after_s"),
    [
        ("OVERHEAT", (20.0, 40.0, 60.0), 85.1, 0.0),
        ("CPU_HIGH", (95.1, 40.0, 60.0), 50.0, 10.0),
        ("MEMORY_HIGH", (20.0, 95.1, 60.0), 50.0, 0.0),
        ("DISK_FULL", (20.0, 40.0, 95.1), 50.0, 0.0),
    ],
)
def test_a_computer_in_trouble_warns_and_drives_on(
    code: str, usage: tuple[float, float, float], temperature_c: float, after_s: float
) -> None:
    story = Story().healthy()
    story.usage, story.temperature_c = usage, temperature_c
    if after_s:
        story.before(after_s).expect(NORMAL, ())
    story.run(0.05).expect(DEGRADED, (code,), linear_mps=1.5, reason="", action=SafetyAction.WARN)
    story.usage = story.temperature_c = None
    story.run(3.0).expect(DEGRADED, (code,))  # missing values do not clear the fault
    story.usage, story.temperature_c = (20.0, 40.0, 60.0), 50.0
    story.tick().expect(NORMAL, ())


def test_a_busy_moment_is_no_busy_processor() -> None:
    story = Story().healthy()
    for _ in range(3):
        story.usage = (100.0, 40.0, 60.0)
        story.run(9.0).expect(NORMAL, ())
        story.usage = (94.0, 40.0, 60.0)
        story.run(0.1).expect(NORMAL, ())


def test_missing_computer_status_raises_no_computer_fault() -> None:
    story = Story()
    story.usage = story.temperature_c = None
    story.healthy().run(20.0).expect(NORMAL, ())


@pytest.mark.parametrize("code", ["EHMI_LINK_LOST", "UI_LINK_LOST"])
def test_links_that_fall_silent_warn_until_they_are_back(code: str) -> None:
    story = Story(expected_processes=LINKED)
    story.ehmi_linked = story.ui_connected = True
    story.healthy().run(10.0)
    if code == "EHMI_LINK_LOST":
        story.ehmi_linked = False
    else:
        story.ui_connected = False
    story.before(5.0).expect(NORMAL, ()).past().expect(DEGRADED, (code,), linear_mps=1.5, reason="")
    story.ehmi_linked = story.ui_connected = True
    story.tick().expect(NORMAL, ())


def test_a_screen_that_need_not_be_there_is_missed_only_after_it_was() -> None:
    story = Story(expected_processes=LINKED, links={"ui_required": False})
    story.ehmi_linked = True
    story.healthy().run(10.0).expect(NORMAL, ())
    story.ui_connected = True
    story.run(1.0)
    story.ui_connected = False
    story.run(5.2).expect(DEGRADED, ("UI_LINK_LOST",))


def test_links_of_processes_that_do_not_run_here_are_not_missed() -> None:
    story = Story(expected_processes=("swerve_controller",))
    story.ehmi_linked = story.ui_connected = True
    story.healthy()
    story.ehmi_linked = story.ui_connected = False
    story.run(20.0).expect(NORMAL, ())


def test_a_contact_that_was_never_readable_is_no_press() -> None:
    story = Story()
    story.button = Contact.UNREADABLE
    assert not story.run(30.0).monitor.button_pressed


# --- docking ---------------------------------------------------------------------------------------------------------


def _chair(board_x_m: float) -> NDArray[np.float32]:
    """The board with a passenger, both rails and the castors between them, in base_link."""
    board = [(board_x_m, y, z) for y in np.arange(-0.29, 0.30, 0.05) for z in (0.3, 0.6, 1.2)]
    rails = [(board_x_m + x, side * 0.31, 0.2) for x in np.arange(-0.45, 0.0, 0.05) for side in (1, -1)]
    castors = [(board_x_m - 0.2, side * 0.2, 0.14) for side in (1, -1)]
    return np.array([*board, *rails, *castors], np.float32)


@pytest.mark.parametrize("state", ["SERVOING", "FINE_ALIGN"])
def test_the_last_way_to_the_chair_is_free_and_a_leg_in_it_is_not(state: str) -> None:
    story = Story().healthy()
    story.docking, story.cameras = state, [topic.name for topic in CAMERAS]
    story.driven, story.wheel_radps = Twist2(0.1, 0.0, 0.0), 0.1 / ROBOT.wheel_radius_m
    for board_x_m in np.arange(1.25, 0.945, -0.005):
        story.dock, story.obstacles = Pose2(float(board_x_m), 0.0, 0.0), _chair(float(board_x_m))
        story.run(0.05).expect(NORMAL, (), linear_mps=PARAMS.docking.max_speed_mps, reason="DOCKING")
    leg = np.array([(0.6, 0.1, z) for z in (0.3, 0.6, 0.9)], np.float32)
    story.obstacles = np.concatenate([_chair(0.95), leg])
    story.run(0.1).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)
    at_a_rail = np.array([(0.6, 0.31, z) for z in (0.2, 0.5, 0.9)], np.float32)
    story.obstacles = np.concatenate([_chair(0.95), at_a_rail])
    story.run(0.1).expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)


@pytest.mark.parametrize("why", ["another state", "no target", "silent status", "another source"])
def test_the_chair_is_an_obstacle_unless_it_is_docked_to(why: str) -> None:
    story = Story().healthy()
    story.docking, story.cameras = "SERVOING", [topic.name for topic in CAMERAS]
    story.driven, story.dock, story.obstacles = Twist2(0.1, 0.0, 0.0), Pose2(1.0, 0.0, 0.0), _chair(1.0)
    commands = story.monitor.observation.commands
    for _ in range(50):
        commands.request(topics.DOCKING_CMD_VEL.name, story.driven, story.now_s)
        story.tick().expect(NORMAL, ())
    if why == "another state":
        story.docking = "APPROACH"
    elif why == "no target":
        story.dock = None
    elif why == "silent status":
        story.docking = None
    for _ in range(100):
        commands.request(topics.DOCKING_CMD_VEL.name, story.driven, story.now_s)
        if why == "another source":
            commands.request(topics.TELEOP_CMD_VEL.name, story.driven, story.now_s)
        story.tick()
    story.expect(AVOIDANCE, ("COLLISION_IMMINENT", "OBSTACLE_NEAR"), linear_mps=0.0)


@pytest.mark.parametrize("attached", [True, False])
def test_backing_off_from_the_chair_is_free(attached: bool) -> None:
    """The low parts are remembered, since the top LiDAR cannot see them; the chair still counts as attached."""
    story = Story().healthy()
    story.docking, story.cameras = "FINE_ALIGN", [topic.name for topic in CAMERAS]
    story.dock, story.obstacles = Pose2(0.95, 0.0, 0.0), _chair(0.95)
    story.run(1.0).expect(NORMAL, ())
    story.carry(attached)
    story.docking, story.dock = "APPROACH", None
    story.request = story.driven = Twist2(-0.1, 0.0, 0.0)
    story.wheel_radps = -0.1 / ROBOT.wheel_radius_m
    for gone_m in np.arange(0.0, 0.5, 0.005):
        story.obstacles = _chair(0.95 + float(gone_m))
        story.run(0.05)
        assert "COLLISION_IMMINENT" not in story.verdict.faults
        assert story.verdict.limit.linear_mps > 0.0
