"""The servo drives as the engine's bus sees them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.plant import drive_loops as loops

from .bench import (
    DRIVE_RAD_PER_COUNT,
    DRIVES,
    PARAMS,
    ROBOT,
    STEER_RAD_PER_COUNT,
    STEERS,
    Bench,
    make_bench,
)

FL_DRIVE, FL_STEER = 0, 1
SETTINGS = PARAMS.drives


@pytest.fixture
def bench() -> Bench:
    made = make_bench()
    made.run(0.2)
    return made


@pytest.fixture
def rolling(bench: Bench) -> Bench:
    """Servos on, driving straight ahead at 0.5 m/s."""
    bench.servo()
    bench.ramp(0.5 / ROBOT.wheel_radius_m, 1.0)
    bench.run(0.3)
    return bench


def test_servo_on_takes_its_time_and_nothing_moves_before(bench: Bench) -> None:
    before = bench.inp.position_counts.copy()
    bench.command(5.0, 1.0)
    bench.run(0.3)
    assert abs(bench.twist().vx) < 1e-5, "without servo nothing moves"
    assert bench.inp.position_counts == pytest.approx(before, abs=1)
    assert bench.inp.torque_percent == pytest.approx([0.0] * 8, abs=0.1)
    bench.command(0.0)
    bench.out.outputs[2] = 0b101
    bench.out.servo_on[:] = True
    bench.run(SETTINGS.servo_on_delay_s - 0.005)
    assert bench.world.drives.outputs.tolist() == [0, 0, 0b101, 0, 0, 0, 0, 0]
    assert not bench.inp.servo_on.any()
    bench.run(0.010)
    assert bench.inp.servo_on.all()


def test_a_command_acts_one_cycle_later_and_its_effect_is_seen_one_cycle_after_that() -> None:
    """Two worlds with the same noise; in one the speed command steps up in cycle 0."""

    def torque_of_cycles(speed: float) -> list[float]:
        bench = make_bench()
        bench.servo()
        bench.ramp(1.0, 1.0)  # moving, so that the brakes are open
        bench.command(1.0 + speed)
        seen: list[float] = []
        bench.run(0.005, lambda: seen.append(float(bench.inp.torque_percent[FL_DRIVE])))
        return seen

    difference = np.array(torque_of_cycles(0.1)) - np.array(torque_of_cycles(0.0))
    assert difference[0] == 0.0, "what the bus carries in cycle 0 was measured before"
    assert difference[1] == 0.0, "the command of cycle 0 acts in cycle 1"
    assert difference[2] > 0.0


def test_positions_come_in_counts(rolling: Bench) -> None:
    """Counts are the true angle of one cycle ago, rounded down to the encoder's grid."""
    for _ in range(50):
        true = rolling.world.truth().joint_positions_rad.copy()
        rolling.run(0.001)
        rolling.run(0.001)
        zero = np.repeat(rolling.world.tolerances.steering_zeros_rad, 2) * ([0.0, 1.0] * 4)
        per_count = np.array([DRIVE_RAD_PER_COUNT, STEER_RAD_PER_COUNT] * 4)
        assert rolling.inp.position_counts.tolist() == np.floor((true + zero) / per_count).tolist()


def test_quantisation_is_visible_in_the_speed() -> None:
    """Even without noise the measured speed ripples at constant speed, since positions come in counts."""
    quiet = SETTINGS.model_copy(
        update={
            "torque_noise_nm": SETTINGS.torque_noise_nm.model_copy(update={"drive": 0.0, "steer": 0.0}),
            "cogging_nm": SETTINGS.cogging_nm.model_copy(update={"drive": 0.0, "steer": 0.0}),
        }
    )
    bench = make_bench(params=PARAMS.model_copy(update={"drives": quiet}))
    bench.servo()
    bench.ramp(0.5 / ROBOT.wheel_radius_m, 1.0)
    bench.run(1.0)
    seen: list[float] = []
    true: list[float] = []

    def look() -> None:
        seen.append(float(bench.inp.velocity_counts_per_s[FL_DRIVE]) * DRIVE_RAD_PER_COUNT)
        true.append(float(bench.world.truth().joint_speeds_radps[FL_DRIVE]))

    bench.run(0.5, look)
    ripple = float(np.std(np.array(seen) - np.array(true)))
    assert 0.005 < ripple < 0.1
    assert np.mean(seen) == pytest.approx(np.mean(true), rel=1e-3)


def test_torque_falls_with_speed() -> None:
    matrix = make_bench().world.drives._parameters
    corner, top = SETTINGS.drive.constant_torque_speed_radps, ROBOT.drive.max_speed_radps
    peak = ROBOT.drive.max_torque_nm
    limit = loops._torque_limit
    assert limit(FL_DRIVE, 1.0, corner, matrix) == pytest.approx(peak)
    assert limit(FL_DRIVE, 1.0, 0.5 * (corner + top), matrix) == pytest.approx(0.5 * peak)
    assert limit(FL_DRIVE, 1.0, top, matrix) == 0.0
    assert limit(FL_DRIVE, -1.0, top, matrix) == pytest.approx(peak), "braking keeps the full torque"
    bench = make_bench()
    bench.servo()
    bench.command(ROBOT.drive.max_speed_radps)
    seen: list[float] = []
    bench.run(0.3, lambda: seen.append(float(np.max(np.abs(bench.inp.torque_percent)))))
    assert 90.0 < max(seen) <= 100.0


def test_steering_follows_a_profile(bench: Bench) -> None:
    bench.servo()
    for turn in (2.0, 4.0):  # without end
        bench.turn_modules(np.full(4, turn))
    target = np.array([4.8, 3.2, 5.5, 2.5])
    bench.turn_modules(target)
    bench.run(0.2)
    assert bench.inp.position_counts[STEERS] * STEER_RAD_PER_COUNT == pytest.approx(target, abs=0.003)
    assert bench.world.truth().joint_positions_rad[STEERS] == pytest.approx(target, abs=0.004)


@pytest.mark.parametrize(("axis", "bad"), [(FL_DRIVE, math.nan), (FL_DRIVE, -math.inf), (FL_STEER, math.inf)])
def test_non_finite_command_stops_axis_and_is_not_passed_to_physics(rolling: Bench, bad: float, axis: int) -> None:
    rolling.out.velocity_counts_per_s[axis] = bad
    rolling.run(0.05)
    assert rolling.inp.alarm_code[axis] == loops.ALARM_INVALID_COMMAND
    assert not rolling.inp.servo_on[axis]
    rolling.out.servo_on[:] = False
    rolling.run(2.5)
    truth = rolling.world.truth()
    assert np.isfinite(truth.joint_positions_rad).all()
    assert np.isfinite(truth.joint_torques_nm).all()
    assert abs(rolling.twist().vx) < 1e-3
    assert rolling.world.drives.brakes_closed[DRIVES].all()


def test_brake_closes_at_rest_and_when_the_servo_goes_off(bench: Bench) -> None:
    bench.servo()
    assert bench.world.drives.brakes_closed[DRIVES].all(), "at rest the brake stays closed until a speed is asked for"
    bench.command(1.0)
    bench.run(SETTINGS.brake_release_delay_s + 0.005)
    assert not bench.world.drives.brakes_closed[DRIVES].any()
    bench.command(0.0)
    bench.run(0.2)
    assert not bench.world.drives.brakes_closed[DRIVES].any()
    bench.run(SETTINGS.brake_hold_delay_s + 0.5)
    assert bench.world.drives.brakes_closed[DRIVES].all(), "at rest it relieves the motor"
    assert bench.inp.servo_on.all()
    assert bench.inp.torque_percent[DRIVES] == pytest.approx([0.0] * 4, abs=0.5)
    bench.command(1.0)
    bench.run(SETTINGS.brake_release_delay_s + 0.005)
    bench.command(0.0)
    bench.run(0.2)
    bench.out.servo_on[:] = False
    bench.run(0.01)
    assert bench.world.drives.brakes_closed[DRIVES].all()
    bench.talking = False
    bench.run(0.3)
    assert (bench.world.drives.alarm_codes == 0).all(), "a bus that stops after the servos raises no alarm"


def test_servo_off_in_motion_brakes_softly_before_the_brake_closes(rolling: Bench) -> None:
    rolling.out.servo_on[:] = False
    rolling.run(0.02)
    assert not rolling.world.drives.brakes_closed[DRIVES].any(), "closing now would lock the wheels"
    rolling.run(2.0)
    assert rolling.world.drives.brakes_closed[DRIVES].all()
    assert abs(rolling.twist().vx) < 1e-3


def test_a_silent_bus_stops_the_robot_by_itself(rolling: Bench) -> None:
    """0.1 s of silence, then 2.0 m/s2 from 0.5 m/s: at rest after 0.35 s plus lag."""
    drives, before = rolling.world.drives, rolling.inp.position_counts.copy()
    drives.set_bus(False)
    rolling.run(0.02)
    assert drives.exchange(rolling.out, rolling.inp) is False
    assert (rolling.inp.position_counts == before).all()
    drives.set_bus(True)
    assert drives.exchange(rolling.out, rolling.inp) is True
    assert (rolling.inp.position_counts[DRIVES] > before[DRIVES]).all()
    rolling.talking = False
    rolling.run(SETTINGS.bus_watchdog_s - 0.005)
    assert rolling.twist().vx == pytest.approx(0.5, abs=0.02), "a short silence is no reason to stop"
    rolling.run(0.02)
    before = rolling.twist().vx
    rolling.run(0.1)
    assert before - rolling.twist().vx == pytest.approx(0.2, abs=0.06)
    rolling.run(0.5)
    assert abs(rolling.twist().vx) < 0.01
    assert rolling.world.drives.brakes_closed[DRIVES].all()
    rolling.run(1.5)
    rolling.talking = True
    rolling.run(0.01)
    assert (rolling.inp.alarm_code == loops.ALARM_BUS).all()
    assert not rolling.inp.servo_on.any(), "the bus alone does not bring the drives back"


def test_a_drive_alarm_takes_the_axis_off_until_cause_and_alarm_are_cleared(rolling: Bench) -> None:
    rolling.world.drives.set_alarm(FL_DRIVE, 0x4210)
    rolling.run(0.01)
    assert rolling.inp.alarm_code[FL_DRIVE] == 0x4210
    assert not rolling.inp.servo_on[FL_DRIVE]
    assert rolling.inp.servo_on[1:].all()
    rolling.out.servo_on[:] = False
    rolling.out.clear_alarm[FL_DRIVE] = True
    rolling.run(0.1)
    assert rolling.inp.alarm_code[FL_DRIVE] == 0x4210, "the cause persists"
    rolling.world.drives.set_alarm(FL_DRIVE, 0)
    rolling.run(0.05)
    assert rolling.inp.alarm_code[FL_DRIVE] == 0
    rolling.out.clear_alarm[FL_DRIVE] = False
    rolling.world.drives.set_alarm(FL_DRIVE, 0x4210)
    rolling.run(0.01)
    rolling.world.drives.set_alarm(FL_DRIVE, 0)
    rolling.run(0.1)
    assert rolling.inp.alarm_code[FL_DRIVE] == 0x4210, "an alarm never clears itself"
    rolling.out.clear_alarm[FL_DRIVE] = True
    rolling.run(0.001)
    rolling.out.clear_alarm[FL_DRIVE] = False
    rolling.run(0.02)
    assert rolling.inp.alarm_code[FL_DRIVE] == 0, "one cycle of clearing is enough"


def test_a_frozen_encoder_ends_in_an_overload_alarm(rolling: Bench) -> None:
    """The drive measures a standing wheel, applies its maximum torque, and raises the alarm after the overload time."""
    rolling.world.drives.set_encoder_frozen(FL_DRIVE, True)
    rolling.run(0.1)
    frozen = rolling.inp.position_counts[FL_DRIVE]
    rolling.run(2.0)
    assert rolling.inp.position_counts[FL_DRIVE] == frozen
    assert rolling.inp.alarm_code[FL_DRIVE] == loops.ALARM_OVERLOAD


def test_a_steering_command_out_of_reach_is_a_following_error(bench: Bench) -> None:
    bench.servo()
    bench.command(0.0, np.array([SETTINGS.position_error_rad + 0.1, 0.0, 0.0, 0.0]))
    bench.run(0.005)
    assert bench.inp.alarm_code.tolist() == [0, loops.ALARM_FOLLOWING_ERROR, 0, 0, 0, 0, 0, 0]


def test_a_wheel_that_overspeeds_alarms() -> None:
    """The wheel is spun beyond its maximum speed from outside, with no fault injected."""
    bench = make_bench()
    bench.servo()
    index = bench.world._index
    bench.command(1.0)
    bench.run(0.05)
    bench.world.data.qvel[index.qvel[FL_DRIVE]] = 2.0 * ROBOT.drive.max_speed_radps

    def spin() -> None:
        bench.world.data.qvel[index.qvel[FL_DRIVE]] = 2.0 * ROBOT.drive.max_speed_radps

    bench.run(0.02, spin)
    assert bench.inp.alarm_code[FL_DRIVE] == loops.ALARM_OVERSPEED


def test_estop_bit_is_normally_closed(bench: Bench) -> None:
    byte, mask = ROBOT.estop_input_byte, 1 << ROBOT.estop_input_bit
    # The latch is open: its closed switch in the same byte reads 0.
    others = 0xFF & ~mask & ~(1 << ROBOT.latch.closed_input_bit)
    bench.inp.inputs[byte] |= others
    bench.run(0.001)
    assert bench.inp.inputs[byte] == others | mask, "released reads 1, and other bits stay as they are"
    bench.world.drives.set_estop_pressed(True)
    bench.run(0.001)
    assert bench.inp.inputs[byte] == others
    bench.world.drives.set_estop_pressed(False)
    bench.run(0.001)
    assert bench.inp.inputs[byte] == others | mask
