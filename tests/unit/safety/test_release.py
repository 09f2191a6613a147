"""The two-key release: its conditions, its messages when one is missing, and that nothing else releases."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from robot_stack.contract.model import SafetyState
from robot_stack.core.stop_presence import Presence
from robot_stack.safety.monitor import Memory, ResetAnswer
from tests.unit.safety.story import GOOD_AXIS, PARAMS, ROBOT, TICK_S, Story, replace

EMERGENCY, NORMAL = SafetyState.EMERGENCY_STOP, SafetyState.NORMAL
STANDSTILL_RADPS = PARAMS.standstill_mps / ROBOT.wheel_radius_m
NOT_STILL = "the robot is not at standstill (every wheel below 0.05 m/s for 0.3 s, by fresh /joint_states)"
STILL_TRUE = "ESTOP_PRESSED: pressed by touch_ui"


def test_reset_without_a_latched_fault_is_refused() -> None:
    story = Story().healthy()
    assert story.reset() == ResetAnswer(True, "no emergency stop is latched")
    story.expect(NORMAL, ())


def test_pressed() -> None:
    story = Story().healthy().estop(True).run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: {STILL_TRUE}")
    story.expect(EMERGENCY)


def test_false_of_another_source_does_not_release() -> None:
    story = Story().healthy().estop(True).estop(True, "supervisor").run(1.0).estop(False, "supervisor").run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: {STILL_TRUE}")
    story.estop(False, None).run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: {STILL_TRUE}")
    story.estop(False).run(1.0)
    assert story.reset().success


def test_press_shorter_than_a_tick_latches() -> None:
    story = Story().healthy()
    for pressed in (True, False):
        story.presses["touch_ui"], story.pressed["touch_ui"] = 1, pressed
        story.monitor.observation.emergency_stop(pressed, story.now_s)
        story.report("touch_ui")
    story.step().expect(EMERGENCY, ("ESTOP_PRESSED",))
    assert story.monitor.details == {"ESTOP_PRESSED": "/emergency_stop is true"}
    story.run(1.0)
    assert story.reset().success


def test_a_true_that_is_cleared_but_not_followed_by_a_false_holds() -> None:
    story = Story().healthy().estop(True, None).run(3.0)
    assert story.clear("unknown").success
    assert story.reset() == ResetAnswer(False, "refused: ESTOP_PRESSED: /emergency_stop is true")
    story.estop(False, None).run(1.0)
    assert story.reset().success


def test_a_true_without_an_author_is_cleared_by_name() -> None:
    story = Story().healthy().estop(True, None).estop(False, None).run(1.0)
    assert "whose source has not reported yet" in story.reset().message
    story.run(3.0)
    assert story.reset() == ResetAnswer(False, "refused: ESTOP_PRESSED: pressed by unknown")
    assert story.monitor.pressed_by(story.now_s) == {"unknown": Presence.UNKNOWN}
    assert story.clear("touch_ui") == ResetAnswer(False, "refused: 'touch_ui' is not pressed; pressed: unknown")
    assert story.clear("unknown") == ResetAnswer(True, "cleared: unknown")
    story.expect(EMERGENCY)  # clearing is no reset
    assert story.reset().success


def test_a_retained_false_of_another_does_not_hide_a_retained_true_from_a_restarted_monitor() -> None:
    story = Story().healthy().estop(True).restarted()
    story.estop(False, None).run(5.0)
    assert story.reset() == ResetAnswer(False, f"refused: {STILL_TRUE}")


def test_a_source_that_died_pressed_stays_pressed_until_cleared_by_name() -> None:
    story = Story().healthy().estop(True)
    assert story.monitor.pressed_by(story.now_s) == {"touch_ui": Presence.THERE}
    assert story.clear("touch_ui").message.startswith("refused: touch_ui is running")
    story.reporting.discard("touch_ui")
    story.run(5.0).estop(False, None).run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: {STILL_TRUE} (gone)")
    assert story.monitor.pressed_by(story.now_s) == {"touch_ui": Presence.GONE}
    story.presses["touch_ui"], story.pressed["touch_ui"] = 0, False
    story.report("touch_ui", pid=2)  # the restarted process, which has no press
    assert not story.reset().success
    assert story.clear("touch_ui").success
    assert story.reset().success


def test_dead_button_process_is_an_emergency_until_it_returns() -> None:
    story = Story().healthy()
    story.run(0.2 - (story.ticks % 20) * TICK_S)
    story.reporting.discard("emergency_stop_button")
    story.run(PARAMS.stop_sources.button_silence_s - 0.02).expect(NORMAL, ())
    story.run(0.04).expect(EMERGENCY, ("ESTOP_PRESSED",))
    assert story.monitor.details["ESTOP_PRESSED"].startswith("no message from emergency_stop_button for 0.4")
    story.estop(True).estop(False).run(1.0)
    assert "no message from emergency_stop_button" in story.reset().message
    story.reporting.add("emergency_stop_button")
    story.run(0.5)
    assert story.reset().success


def test_a_button_that_is_not_expected_is_not_missed() -> None:
    story = Story(expected_processes=("swerve_controller",)).healthy()
    story.reporting.clear()
    story.run(5.0).expect(NORMAL, ())


def test_a_limit_that_is_not_obeyed_is_an_emergency() -> None:
    story = Story().healthy()
    story.wheel_radps = 1.3 / ROBOT.wheel_radius_m
    story.run(2.0).expect(NORMAL)
    story.imu_tilt_deg = 6.0  # 0.3 m/s
    story.run(2.0)
    story.run(3.0).expect(EMERGENCY, ("OVERSPEED", "SLOPE"))
    story.wheel_radps, story.imu_tilt_deg = 0.0, 0.0
    story.run(3.0)
    assert story.reset() == ResetAnswer(True, "released: OVERSPEED")


def test_a_limit_that_is_obeyed_along_the_ramp_is_none() -> None:
    story = Story().healthy()
    story.wheel_radps = 1.3 / ROBOT.wheel_radius_m
    story.run(1.0)
    story.carry()  # 1.0 m/s
    for speed_mps in (1.3, 1.25, 1.2, 1.1, 1.0, 1.0, 1.0, 1.0):
        story.wheel_radps = speed_mps / ROBOT.wheel_radius_m
        story.run(0.2).expect(NORMAL, ())


def test_released_only_just_now() -> None:
    story = Story().healthy().estop(True).run(1.0).estop(False)
    wanted = ResetAnswer(False, "refused: /emergency_stop has been false for less than 0.3 s")
    assert story.reset() == wanted
    story.before(PARAMS.release_settle_s)
    assert story.reset() == wanted
    story.past()
    assert story.reset().success


def test_exactly_the_settling_and_standing_times_are_enough() -> None:
    story = Story(start_s=64.0, release_settle_s=0.25, standstill_hold_s=0.25, startup_settle_s=0.25)
    for _ in range(40):
        story.tick(0.0625)
    story.wheel_radps = 5.0
    story.estop(True).tick(0.0625)
    story.wheel_radps = 0.0
    story.tick(0.0625).estop(False)
    for _ in range(3):
        story.tick(0.0625)
        assert not story.reset().success
    story.tick(0.0625)
    assert story.reset().success


def test_exactly_the_settling_time_is_enough() -> None:
    story = Story(start_s=64.0, release_settle_s=0.25)
    for _ in range(40):
        story.tick(0.0625)
    story.estop(True).estop(False)
    for _ in range(3):
        assert not story.tick(0.0625).reset().success
    assert story.tick(0.0625).reset().success


def test_a_button_that_repeats_true_within_the_settling_time_wins() -> None:
    story = Story().healthy().estop(True).run(1.0)
    for _ in range(5):
        story.estop(False).run(0.2).estop(True)
        assert not story.reset().success
    story.expect(EMERGENCY)


def test_a_second_false_does_not_start_the_settling_again() -> None:
    story = Story().healthy().estop(True).run(1.0).estop(False).run(0.25).estop(False).run(0.1)
    assert story.reset().success


def test_moving() -> None:
    story = Story().healthy().estop(True).estop(False)
    story.wheel_radps = -STANDSTILL_RADPS * 1.01
    story.run(1.0)
    assert story.reset() == ResetAnswer(False, f"refused: {NOT_STILL}")
    story.wheel_radps = STANDSTILL_RADPS * 0.99
    story.tick().before(PARAMS.standstill_hold_s)
    assert story.reset() == ResetAnswer(False, f"refused: {NOT_STILL}")
    story.past()
    assert story.reset().success


def test_unknown_wheel_speeds_are_no_standstill() -> None:
    story = Story().healthy().estop(True).estop(False).run(1.0)
    story.wheel_radps = None
    story.run(0.09)
    assert story.reset().success
    story.run(0.05).expect(EMERGENCY)
    answer = story.reset()
    assert not answer.success
    assert NOT_STILL in answer.message


def test_everything_missing_at_once_is_named() -> None:
    story = Story().healthy().estop(True).axis(0, amp_alarm=True)
    story.wheel_radps = 5.0
    story.run(1.0)
    message = f"refused: {NOT_STILL}; {STILL_TRUE}; DRIVE_FAULT: amplifier alarm: fl_drive"
    assert story.reset() == ResetAnswer(False, message)


def test_a_fault_without_any_button_needs_no_release() -> None:
    story = Story().healthy().axis(0, amp_alarm=True).tick().axis(0, amp_alarm=False).run(1.0)
    assert story.reset() == ResetAnswer(True, "released: DRIVE_FAULT")


def test_a_release_from_before_a_restart_does_not_count() -> None:
    story = Story().healthy().estop(True).estop(False).run(1.0).restarted().run(5.0)
    assert not story.reset().success
    story.estop(False).run(1.0)
    assert story.reset().success


def test_refused_resets_do_not_add_up() -> None:
    story = Story().healthy().estop(True)
    for _ in range(10):
        assert not story.reset().success
    story.estop(False).run(1.0)
    story.expect(EMERGENCY)
    assert story.reset().success


def test_a_reset_before_the_release_does_not_count() -> None:
    story = Story().healthy().estop(True).run(1.0)
    story.reset()
    story.estop(False).run(5.0).expect(EMERGENCY, ("ESTOP_PRESSED",))


def test_a_press_after_the_release_latches_again() -> None:
    story = Story().healthy().estop(True).estop(False).run(1.0)
    assert story.reset().success
    story.expect(NORMAL).estop(True).expect(EMERGENCY)


def test_the_stop_counts_even_if_it_arrives_with_the_reset() -> None:
    story = Story().healthy().estop(True).estop(False).run(1.0)
    story.monitor.observation.emergency_stop(True, story.now_s)
    assert not story.reset().success
    story.expect(EMERGENCY)


def test_release_keeps_faults_that_are_not_latched() -> None:
    story = Story().healthy()
    story.battery = 0.2
    story.estop(True).estop(False).run(1.0)
    assert story.reset().success
    story.expect(SafetyState.DEGRADED, ("BATTERY_LOW",), linear_mps=1.5)


@dataclass
class Keys:
    """The release rules, implemented independently of the monitor."""

    latched: bool = False
    last_stop: bool | None = None
    stop_latched: bool = False
    released_at_s: float = 0.0
    fast_until_s: float = 0.0
    alarm: bool = False
    good_since_s: float = -math.inf

    def may_release(self, now_s: float) -> bool:
        if self.last_stop or (self.last_stop is None and self.stop_latched) or self.alarm:
            return False
        # A monitor that starts while the drives are faulty has not seen them good yet.
        if now_s - self.good_since_s < PARAMS.startup_settle_s:
            return False
        settled = self.last_stop is None or now_s - self.released_at_s >= PARAMS.release_settle_s - 1e-6
        return settled and now_s - self.fast_until_s >= PARAMS.standstill_hold_s - 1e-6


class TwoKeys(RuleBasedStateMachine):
    """For any events in any order: only both keys end the emergency stop, and until then no motion is permitted."""

    @initialize(crashed=st.booleans())
    def start(self, crashed: bool) -> None:
        self.keys = Keys(latched=crashed, stop_latched=crashed)
        self.story = Story(memory=Memory(("ESTOP_PRESSED",)) if crashed else None)
        self.keys.fast_until_s = self.story.now_s
        self.story.run(3.0)

    @rule(pressed=st.booleans())
    def emergency_stop(self, pressed: bool) -> None:
        if pressed:
            self.keys.latched = self.keys.stop_latched = True
        elif self.keys.last_stop is not False:
            self.keys.released_at_s = self.story.now_s
        self.keys.last_stop = pressed
        self.story.estop(pressed)

    @rule(seconds=st.sampled_from([TICK_S, 0.1, 0.29, 0.31, 1.0]))
    def wait(self, seconds: float) -> None:
        self.story.run(seconds)
        if self.story.wheel_radps:
            self.keys.fast_until_s = self.story.now_s
        if self.keys.alarm:
            self.keys.latched = True

    @rule(moving=st.booleans())
    def wheels(self, moving: bool) -> None:
        self.story.wheel_radps = 3.0 if moving else 0.0

    @rule(alarm=st.booleans())
    def drive_alarm(self, alarm: bool) -> None:
        self.story.axis(5, amp_alarm=alarm)
        self.story.tick()
        if self.story.wheel_radps:
            self.keys.fast_until_s = self.story.now_s
        if alarm and self.story.now_s - self.keys.good_since_s < PARAMS.startup_settle_s:
            self.keys.good_since_s = math.inf
        elif not alarm and self.keys.good_since_s == math.inf:
            self.keys.good_since_s = self.story.now_s
        self.keys.alarm = alarm
        self.keys.latched |= alarm

    @rule()
    def reset(self) -> None:
        was_latched = self.keys.latched
        if abs(self.story.now_s - self.keys.good_since_s - PARAMS.startup_settle_s) < TICK_S / 2.0:
            self.wait(TICK_S)  # the exact moment depends on rounding
        answer = self.story.reset()
        assert answer.success == (not was_latched or self.keys.may_release(self.story.now_s)), answer.message
        if answer.success:
            self.keys.latched = self.keys.stop_latched = False

    @rule()
    def crash(self) -> None:
        old = self.story
        self.story = old.restarted()
        self.story.axes = old.axes  # the wheels stand: without a monitor the drive brakes
        self.keys.last_stop = None
        self.keys.fast_until_s = self.story.now_s
        self.keys.good_since_s = math.inf if self.keys.alarm else -math.inf
        # long enough to observe the engine's cycles and for the sensors to settle
        self.story.run(3.0)

    @invariant()
    def latched_means_standstill(self) -> None:
        if not hasattr(self, "keys"):
            return
        assert self.story.monitor.emergency == self.keys.latched
        verdict = self.story.verdict
        assert (verdict.state is EMERGENCY) == self.keys.latched
        if self.keys.latched:
            assert verdict.limit.linear_mps == verdict.limit.angular_radps == 0.0


TestTwoKeys = TwoKeys.TestCase
TestTwoKeys.settings = settings(max_examples=15, stateful_step_count=20, deadline=None)


@pytest.mark.parametrize("servo_on", [True, False])
def test_released_servos(servo_on: bool) -> None:
    story = Story().healthy().estop(True).estop(False).run(1.0)
    story.axes = [replace(GOOD_AXIS, servo_on=servo_on)] * 8
    story.tick()
    assert story.reset().success
    story.expect(NORMAL if servo_on else SafetyState.DEGRADED)


def test_monitor_names_the_pressed_sources() -> None:
    story = Story().healthy()
    assert not story.monitor.pressed_by(story.now_s)
    story.estop(True)
    assert list(story.monitor.pressed_by(story.now_s)) == ["touch_ui"]
