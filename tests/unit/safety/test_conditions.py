"""Each condition at, below and above its limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from robot_stack.contract import faults, topics
from robot_stack.contract.model import ContractViolation, Criticality, SafetyAction
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import STANDSTILL, SpeedLimit
from robot_stack.safety.collision import FREE, Approach
from robot_stack.safety.collision_prediction import CollisionPrediction, seen_limit_mps
from robot_stack.safety.conditions import CONDITIONS, stale_s, stale_sight_limit, unseen_limit
from robot_stack.safety.inputs import CLEAR, ComputerState, Finding, Level, ProcessAge, Snapshot
from robot_stack.safety.pedestrian_collision import PedestrianCollision
from tests.unit.safety.story import PARAMS, ROBOT

NONE, WARN, LIMIT, STOP, EMERGENCY = SafetyAction
DEGRADED_LIMIT = SpeedLimit(0.5, 0.5)
UNKNOWN = Finding(Level.UNKNOWN)
COOL = ComputerState(temperature_c=50.0, cpu_percent=20.0, cpu_high_for_s=0.0, memory_percent=40.0, disk_percent=60.0)
FREE_WAY = CollisionPrediction(FREE, FREE, FREE, math.inf, reach_m=0.5, brake_mps2=2.0, motion=ROBOT.with_passenger)
WELL = Snapshot(
    uptime_s=100.0,
    estop="",
    drive=CLEAR,
    contact=CLEAR,
    chair_loose=CLEAR,
    latch_not_closed=CLEAR,
    undocking=None,
    docking=None,
    steering=CLEAR,
    overspeed=CLEAR,
    joint_states_up=True,
    joint_states_age_s=0.0,
    joint_states_problem="",
    imu_age_s=0.0,
    imu_problem="",
    inclination_rad=0.0,
    slope=CLEAR,
    pose_age_s=0.0,
    pose_jump_m=0.0,
    quality_age_s=0.0,
    quality=1.0,
    battery_age_s=0.0,
    battery=1.0,
    latch_problem="",
    processes={},
    cameras={},
    lidar_age_s=0.0,
    lidar_problem="",
    overhead_lidar_age_s=0.0,
    overhead_lidar_problem="",
    obstacles_age_s=0.0,
    obstacles_problem="",
    sight_age_s=0.0,
    prediction=FREE_WAY,
    computer=COOL,
    ehmi_silent_s=0.0,
    ui_silent_s=0.0,
)


def find(code: str, active_action: SafetyAction = NONE, **changes: Any) -> Finding:
    return CONDITIONS[code](replace(WELL, **changes), PARAMS, active_action)


def present(action: SafetyAction, detail: str, limit: SpeedLimit | None = None) -> Finding:
    return Finding(Level.PRESENT, action, limit, detail)


def test_every_fault_of_the_contract_has_a_condition_and_is_watched() -> None:
    assert set(CONDITIONS) == set(PARAMS.rows) == set(faults.BY_CODE)


@pytest.mark.parametrize("code", CONDITIONS)
@pytest.mark.parametrize("active_action", list(SafetyAction))
def test_clear_when_all_is_well(code: str, active_action: SafetyAction) -> None:
    assert find(code, active_action) == CLEAR


@pytest.mark.parametrize("code", CONDITIONS)
def test_action_is_at_most_that_of_the_contract(code: str) -> None:
    worst: dict[str, Any] = {
        "uptime_s": math.inf,
        "estop": "pressed",
        "contact": present(EMERGENCY, "front"),
        "chair_loose": present(EMERGENCY, "loose"),
        "latch_not_closed": present(STOP, "loose"),
        "steering": present(EMERGENCY, "stuck"),
        "drive": present(EMERGENCY, "broken"),
        "overspeed": present(EMERGENCY, "too fast"),
        "joint_states_age_s": math.inf,
        "imu_age_s": math.inf,
        "inclination_rad": math.pi,
        "slope": present(STOP, "steep"),
        "pose_age_s": math.inf,
        "quality_age_s": math.inf,
        "battery": 0.0,
        "latch_problem": "disk full",
        "processes": {"a": ProcessAge(Criticality.CRITICAL, math.inf)},
        "cameras": {"/a": math.inf},
        "lidar_age_s": math.inf,
        "overhead_lidar_age_s": math.inf,
        "obstacles_age_s": math.inf,
        "prediction": replace(FREE_WAY, moving=Approach(0.0, 0.0)),
        "computer": ComputerState(120.0, 100.0, math.inf, 100.0, 100.0),
        "ehmi_silent_s": math.inf,
        "ui_silent_s": math.inf,
    }
    assert find(code, **worst).action is faults.BY_CODE[code].action


def test_stale_limits_come_from_the_contract() -> None:
    assert stale_s(topics.IMU) == topics.IMU.stale_s == 0.1
    with pytest.raises(ContractViolation, match="/plan has no staleness limit"):
        stale_s(topics.PLAN)


def test_estop() -> None:
    assert find("ESTOP_PRESSED", estop="the button") == present(EMERGENCY, "the button")


def test_drive_condition_returns_the_finding_of_its_watch() -> None:
    found = Finding(Level.WAITING, STOP, None, "coming up")
    assert find("DRIVE_FAULT", drive=found) is found
    assert find("OVERSPEED", overspeed=found) is found
    assert find("CONTACT", contact=found) is found
    assert find("CHAIR_LOOSE", chair_loose=found) is found
    assert find("STEERING_FAULT", steering=found) is found
    assert find("LATCH_NOT_CLOSED", latch_not_closed=found) is found


def test_joint_states() -> None:
    assert find("JOINT_STATES_TIMEOUT", joint_states_age_s=0.1) == CLEAR
    late = find("JOINT_STATES_TIMEOUT", joint_states_age_s=0.1001)
    assert late == present(EMERGENCY, "/joint_states: silent for 0.10 s")
    assert find("JOINT_STATES_TIMEOUT", joint_states_age_s=0.2, joint_states_problem="junk") == present(
        EMERGENCY, "/joint_states: junk"
    )
    assert find("JOINT_STATES_TIMEOUT", joint_states_age_s=0.05, joint_states_problem="junk") == CLEAR


def test_joint_states_that_are_not_up_wait_for_the_grace() -> None:
    never = {"joint_states_up": False, "joint_states_age_s": math.inf}
    waiting = Finding(Level.WAITING, STOP, None, "/joint_states: never received")
    assert find("JOINT_STATES_TIMEOUT", uptime_s=PARAMS.startup_grace_s, **never) == waiting
    after = find("JOINT_STATES_TIMEOUT", uptime_s=PARAMS.startup_grace_s + 1e-6, **never)
    assert after == present(EMERGENCY, "/joint_states: never received")
    assert find("JOINT_STATES_TIMEOUT", uptime_s=math.inf, **never).level is Level.PRESENT
    assert find("JOINT_STATES_TIMEOUT", uptime_s=0.0, joint_states_age_s=1.0).level is Level.PRESENT


@pytest.mark.parametrize("uptime_s", [0.0, PARAMS.startup_grace_s, math.inf])
def test_joint_states_that_have_just_come_settle(uptime_s: float) -> None:
    settling = find("JOINT_STATES_TIMEOUT", uptime_s=uptime_s, joint_states_up=False, joint_states_age_s=0.1)
    assert settling == Finding(Level.WAITING, STOP, None, "/joint_states: settling")


@pytest.mark.parametrize("active_action", [NONE, EMERGENCY])
def test_tilt(active_action: SafetyAction) -> None:
    assert find("TILT", active_action, inclination_rad=math.nan) == UNKNOWN
    limit_deg = 15.0 if active_action is NONE else PARAMS.tilt_clear_deg
    assert find("TILT", active_action, inclination_rad=math.radians(limit_deg)) == CLEAR
    steep = find("TILT", active_action, inclination_rad=math.radians(limit_deg) + 1e-9)
    assert steep == present(EMERGENCY, f"inclination {limit_deg:.1f} deg")


def test_slope_condition_returns_the_finding_of_its_watch() -> None:
    for finding in (CLEAR, UNKNOWN, present(STOP, "inclination 12.0 deg, the motion is not downhill")):
        assert find("SLOPE", slope=finding) is finding


def test_imu() -> None:
    assert find("IMU_TIMEOUT", imu_age_s=0.1) == CLEAR
    assert find("IMU_TIMEOUT", imu_age_s=0.11) == present(LIMIT, "/sensors/imu: silent for 0.11 s", DEGRADED_LIMIT)
    assert find("IMU_TIMEOUT", imu_age_s=math.inf, imu_problem="frozen").detail == "/sensors/imu: frozen"
    assert find("IMU_TIMEOUT", imu_age_s=math.inf).detail == "/sensors/imu: never received"


@pytest.mark.parametrize("active_action", [NONE, STOP])
@pytest.mark.parametrize(
    ("changes", "detail"),
    [
        ({"pose_age_s": 0.5}, ""),
        ({"pose_age_s": 0.51}, "/current_pose: silent for 0.51 s"),
        ({"pose_age_s": math.nan}, "/current_pose: silent for nan s"),
        ({"quality_age_s": 0.5}, ""),
        ({"quality_age_s": 0.51}, "/localization/quality: silent for 0.51 s"),
        ({"quality_age_s": math.inf}, "/localization/quality: never received"),
        ({"pose_jump_m": 1.0}, ""),
        ({"pose_jump_m": 1.01}, "/current_pose jumped by 1.01 m"),
        ({"quality": 0.29}, "localization quality 0.29"),
        ({"quality": 0.51}, ""),
        ({"quality": math.nan}, "localization quality nan"),
    ],
)
def test_localization(active_action: SafetyAction, changes: dict[str, float], detail: str) -> None:
    assert find("LOCALIZATION_LOST", active_action, **changes) == (present(STOP, detail) if detail else CLEAR)


def test_localization_has_to_be_better_to_come_back() -> None:
    assert find("LOCALIZATION_LOST", NONE, quality=0.3) == CLEAR
    assert find("LOCALIZATION_LOST", STOP, quality=0.3).level is Level.PRESENT
    assert find("LOCALIZATION_LOST", STOP, quality=0.5) == present(STOP, "localization quality 0.50")


@pytest.mark.parametrize(
    ("ages", "expected"),
    [
        ({"critical": 1.0, "limiting": 1.0, "optional": 1.0}, CLEAR),
        ({"critical": 1.01, "limiting": 0.0}, present(STOP, "no heartbeat of critical")),
        ({"limiting": 1.01, "optional": 0.0}, present(LIMIT, "no heartbeat of limiting", DEGRADED_LIMIT)),
        ({"optional": math.inf}, present(WARN, "no heartbeat of optional")),
        ({"optional": math.nan}, present(WARN, "no heartbeat of optional")),
        ({"optional": 2.0, "limiting": 2.0}, present(LIMIT, "no heartbeat of optional, limiting", DEGRADED_LIMIT)),
        ({"limiting": 2.0, "critical": 2.0}, present(STOP, "no heartbeat of limiting, critical")),
    ],
)
def test_node_dead(ages: dict[str, float], expected: Finding) -> None:
    processes = {name: ProcessAge(Criticality(name), age) for name, age in ages.items()}
    assert find("NODE_DEAD", processes=processes) == expected


@pytest.mark.parametrize(
    ("code", "threshold", "action", "limit"),
    [("BATTERY_LOW", 0.30, WARN, None), ("BATTERY_CRITICAL", 0.15, LIMIT, DEGRADED_LIMIT)],
)
def test_battery(code: str, threshold: float, action: SafetyAction, limit: SpeedLimit | None) -> None:
    assert find(code, NONE, battery=threshold) == CLEAR
    assert find(code, NONE, battery=threshold - 0.02) == present(action, f"charge {threshold - 0.02:.0%}", limit)
    back = threshold + PARAMS.battery_hysteresis
    assert find(code, action, battery=back) == CLEAR
    assert find(code, action, battery=back - 0.01).level is Level.PRESENT


def test_battery_without_messages() -> None:
    assert find("BATTERY_LOW", battery_age_s=5.0) == find("BATTERY_CRITICAL", battery_age_s=5.0) == CLEAR
    assert find("BATTERY_LOW", battery_age_s=5.1) == present(WARN, "/battery_state: silent for 5.10 s")
    assert find("BATTERY_CRITICAL", battery_age_s=5.1, battery=0.01) == UNKNOWN


# --- cameras ---------------------------------------------------------------------------------------------------------


def test_cameras_that_are_late() -> None:
    assert find("CAMERA_TIMEOUT", cameras={"/front": 0.5, "/rear": 0.0}) == CLEAR
    assert find("CAMERA_TIMEOUT", WARN, cameras={"/front": 0.5, "/rear": 0.5}) == CLEAR
    late = find("CAMERA_TIMEOUT", cameras={"/front": 0.51, "/rear": 0.5})
    assert late == present(WARN, "/front: silent for 0.51 s")
    both = find("CAMERA_TIMEOUT", cameras={"/front": math.inf, "/rear": math.nan})
    assert both == present(WARN, "/front: never received, /rear: silent for nan s")


def test_a_latch_that_is_not_on_disk_is_slow() -> None:
    assert find("LATCH_NOT_STORED") == CLEAR
    assert find("LATCH_NOT_STORED", latch_problem="full") == present(LIMIT, "full", DEGRADED_LIMIT)


# --- computer and links ----------------------------------------------------------------------------------------------


def computer(**changes: float) -> ComputerState:
    return replace(COOL, **changes)


@pytest.mark.parametrize(
    ("code", "name", "limit", "hysteresis", "detail"),
    [
        ("OVERHEAT", "temperature_c", 85.0, 3.0, "the computer is at {:.0f} C"),
        ("MEMORY_HIGH", "memory_percent", 95.0, 1.0, "memory {:.0f} %"),
        ("DISK_FULL", "disk_percent", 95.0, 1.0, "disk {:.0f} %"),
    ],
)
def test_computer(code: str, name: str, limit: float, hysteresis: float, detail: str) -> None:
    assert find(code, computer=computer(**{name: limit})) == CLEAR
    assert find(code, computer=computer(**{name: limit + 0.1})) == present(WARN, detail.format(limit + 0.1))
    assert find(code, WARN, computer=computer(**{name: limit - hysteresis})) == CLEAR
    back = limit - hysteresis + 0.1
    assert find(code, WARN, computer=computer(**{name: back})) == present(WARN, detail.format(back))
    for active_action in (NONE, WARN):
        assert find(code, active_action, computer=computer(**{name: math.nan})) == UNKNOWN


@pytest.mark.parametrize(
    ("active_action", "percent", "for_s", "expected"),
    [
        (NONE, 100.0, 10.0, CLEAR),
        (NONE, 100.0, 10.01, present(WARN, "processor 100 %")),
        (NONE, 95.0, 99.0, CLEAR),
        (WARN, 96.0, 0.0, present(WARN, "processor 96 %")),  # after a gap in the measurements
        (WARN, 95.0, 99.0, CLEAR),
        (NONE, math.nan, 99.0, UNKNOWN),
        (WARN, math.nan, 0.0, UNKNOWN),
    ],
)
def test_cpu_high(active_action: SafetyAction, percent: float, for_s: float, expected: Finding) -> None:
    assert find("CPU_HIGH", active_action, computer=computer(cpu_percent=percent, cpu_high_for_s=for_s)) == expected


@pytest.mark.parametrize(
    ("code", "name", "detail"),
    [
        ("EHMI_LINK_LOST", "ehmi_silent_s", "no acknowledgement of the external display for"),
        ("UI_LINK_LOST", "ui_silent_s", "no page of the touch screen for"),
    ],
)
@pytest.mark.parametrize("active_action", [NONE, WARN])
def test_links(code: str, name: str, detail: str, active_action: SafetyAction) -> None:
    assert find(code, active_action, **{name: None}) == CLEAR
    assert find(code, active_action, **{name: 5.0}) == CLEAR
    assert find(code, active_action, **{name: 5.1}) == present(WARN, f"{detail} 5.1 s")
    assert find(code, active_action, **{name: math.inf}).level is Level.PRESENT


# --- surroundings ----------------------------------------------------------------------------------------------------


def prediction(moving: Approach = FREE, wanted: Approach = FREE) -> CollisionPrediction:
    return replace(FREE_WAY, moving=moving, wanted=wanted)


def pedestrian_collision(somebody: PedestrianCollision, moving: Approach = FREE) -> CollisionPrediction:
    return replace(FREE_WAY, moving=moving, pedestrian_collision=somebody)


def test_lidar_and_obstacles_that_fall_silent() -> None:
    assert find("LIDAR_TIMEOUT", lidar_age_s=0.5, lidar_problem="frozen") == CLEAR
    assert find("LIDAR_TIMEOUT", lidar_age_s=0.51) == present(STOP, "/sensors/lidar/points: silent for 0.51 s")
    assert find("LIDAR_TIMEOUT", lidar_age_s=0.6, lidar_problem="frozen") == present(
        STOP, "/sensors/lidar/points: frozen"
    )
    overhead = "/sensors/overhead_lidar/points"
    assert find("LIDAR_TIMEOUT", overhead_lidar_age_s=0.3, overhead_lidar_problem="frozen") == CLEAR
    assert find("LIDAR_TIMEOUT", overhead_lidar_age_s=0.31) == present(STOP, f"{overhead}: silent for 0.31 s")
    assert find("LIDAR_TIMEOUT", overhead_lidar_age_s=math.nan).level is Level.PRESENT
    both = find("LIDAR_TIMEOUT", lidar_age_s=0.6, overhead_lidar_age_s=0.6, overhead_lidar_problem="frozen")
    assert both == present(STOP, f"/sensors/lidar/points: silent for 0.60 s, {overhead}: frozen")
    assert find("OBSTACLES_TIMEOUT", obstacles_age_s=0.3, obstacles_problem="junk") == CLEAR
    assert find("OBSTACLES_TIMEOUT", obstacles_age_s=0.31) == present(STOP, "/perception/obstacles: silent for 0.31 s")
    assert find("OBSTACLES_TIMEOUT", obstacles_age_s=math.inf, obstacles_problem="junk") == present(
        STOP, "/perception/obstacles: junk"
    )


@pytest.mark.parametrize("code", ["COLLISION_IMMINENT", "OBSTACLE_NEAR"])
@pytest.mark.parametrize("active_action", [NONE, LIMIT, STOP])
def test_collision_is_unknown_without_obstacles(code: str, active_action: SafetyAction) -> None:
    assert find(code, active_action, prediction=None) == UNKNOWN


@pytest.mark.parametrize(
    ("active_action", "seen", "expected"),
    [
        (NONE, prediction(Approach(1.0, 0.15)), CLEAR),
        (NONE, prediction(Approach(0.99, 5.0)), present(STOP, "collision in 1.0 s")),
        (NONE, prediction(Approach(5.0, 0.149)), present(STOP, "obstacle 0.15 m ahead")),
        (NONE, prediction(wanted=Approach(0.5, 0.15)), CLEAR),  # the speed limit applies first
        (NONE, prediction(wanted=Approach(9.0, 0.14)), present(STOP, "obstacle 0.14 m ahead")),
        (STOP, prediction(Approach(1.3, 0.2)), CLEAR),
        (STOP, prediction(Approach(1.29, 5.0)), present(STOP, "collision in 1.3 s")),
        (STOP, prediction(Approach(5.0, 0.19)), present(STOP, "obstacle 0.19 m ahead")),
        (STOP, prediction(wanted=Approach(5.0, 0.19)), present(STOP, "obstacle 0.19 m ahead")),
        (
            NONE,
            pedestrian_collision(PedestrianCollision(stop=True, speed_mps=0.0)),
            present(STOP, "pedestrian entering the path"),
        ),
        (NONE, pedestrian_collision(PedestrianCollision(stop=False, speed_mps=0.0)), CLEAR),
    ],
)
def test_collision_imminent(active_action: SafetyAction, seen: CollisionPrediction, expected: Finding) -> None:
    assert find("COLLISION_IMMINENT", active_action, prediction=seen) == expected


def near(clearance_m: float, linear_mps: float, angular_radps: float) -> Finding:
    return Finding(
        Level.PRESENT,
        LIMIT,
        SpeedLimit(linear_mps, pytest.approx(angular_radps)),
        f"obstacle {clearance_m:.2f} m ahead",
    )


@pytest.mark.parametrize(
    ("active_action", "seen", "expected"),
    [
        (NONE, prediction(Approach(3.0, 1.0)), CLEAR),
        (NONE, prediction(Approach(2.99, 4.0)), near(4.0, 1.6, 3.2)),
        (NONE, prediction(Approach(9.0, 0.75)), near(0.75, 0.3, 0.6)),
        (NONE, prediction(Approach(9.0, 9.0), Approach(2.9, 0.5)), near(0.5, 0.2, 0.4)),
        (NONE, prediction(wanted=Approach(2.9, 4.0)), near(4.0, 1.6, 3.2)),
        (NONE, prediction(Approach(0.5, 0.0)), near(0.0, 0.05, 0.1)),
        (LIMIT, prediction(Approach(3.3, 1.05)), CLEAR),
        (LIMIT, prediction(Approach(3.29, 4.0)), near(4.0, 1.6, 3.2)),
        (LIMIT, prediction(Approach(9.0, 1.04)), near(1.04, 0.41, 0.82)),
        (
            NONE,
            pedestrian_collision(PedestrianCollision(speed_mps=0.4)),
            present(LIMIT, "pedestrian approaching", SpeedLimit(0.4, pytest.approx(0.8))),
        ),
        (NONE, pedestrian_collision(PedestrianCollision(speed_mps=0.2), Approach(9.0, 0.75)), near(0.75, 0.2, 0.4)),
        (NONE, pedestrian_collision(PedestrianCollision(speed_mps=0.4), Approach(9.0, 0.75)), near(0.75, 0.3, 0.6)),
    ],
)
def test_obstacle_near(active_action: SafetyAction, seen: CollisionPrediction, expected: Finding) -> None:
    found = find("OBSTACLE_NEAR", active_action, prediction=seen)
    assert (found.level, found.action, found.detail) == (expected.level, expected.action, expected.detail)
    assert (found.limit is None) == (expected.limit is None)
    if found.limit is not None and expected.limit is not None:
        assert found.limit.linear_mps == pytest.approx(expected.limit.linear_mps)
        assert found.limit.angular_radps == expected.limit.angular_radps


def test_speed_limit_stops_within_the_seen_path() -> None:
    def limit(seen: CollisionPrediction | None) -> SpeedLimit | None:
        return unseen_limit(replace(WELL, prediction=seen), PARAMS)

    assert limit(None) is None
    assert limit(FREE_WAY) is None
    ends = replace(FREE_WAY, unseen=Approach(1.0, 1.5), reach_m=0.4)
    found = limit(ends)
    assert found is not None
    assert found.linear_mps == seen_limit_mps(1.5, PARAMS.collision, ROBOT.with_passenger)
    assert 0.0 < found.linear_mps < 2.0
    assert found.angular_radps == pytest.approx(found.linear_mps / 0.4)


def test_speed_limit_stops_at_the_end_of_known_ground() -> None:
    for clearance_m, unseen_m, linear_mps in (
        (0.1, math.inf, 0.0),
        (0.1, 0.1, 0.0),
        (0.4, math.inf, 0.24),
        (5.0, 0.1, 0.3),
    ):
        ends = replace(FREE_WAY, no_ground=Approach(1.0, clearance_m), unseen=Approach(1.0, unseen_m), reach_m=0.5)
        found = unseen_limit(replace(WELL, prediction=ends), PARAMS)
        assert found is not None
        assert found.linear_mps == pytest.approx(linear_mps)
        assert found.angular_radps == pytest.approx(2.0 * linear_mps)


def test_without_obstacles_no_unseen_limit_applies() -> None:
    rows = tuple(code for code in PARAMS.rows if code != "OBSTACLES_TIMEOUT")
    ends = replace(FREE_WAY, unseen=Approach(1.0, 1.5))
    assert unseen_limit(replace(WELL, prediction=ends), PARAMS.model_copy(update={"rows": rows})) is None


SIGHT_STALE_S, UNSEEN_MPS = PARAMS.obstacles.sight_stale_s, PARAMS.collision.unseen_mps


@pytest.mark.parametrize(
    ("measured", "limit"),
    [
        (Twist2(1.0, 0.0, 0.0), STANDSTILL),
        (Twist2(0.0, -UNSEEN_MPS - 1e-6, 0.0), STANDSTILL),
        (Twist2(UNSEEN_MPS, 0.0, 0.0), SpeedLimit(UNSEEN_MPS, 2.0 * UNSEEN_MPS)),
        (Twist2(0.0, 0.0, -2.0 * UNSEEN_MPS - 1e-6), STANDSTILL),
        (Twist2(UNSEEN_MPS, 0.0, 2.0 * UNSEEN_MPS), SpeedLimit(UNSEEN_MPS, 2.0 * UNSEEN_MPS)),
        (ZERO_TWIST, SpeedLimit(UNSEEN_MPS, 2.0 * UNSEEN_MPS)),
        (Twist2(math.nan, 0.0, 0.0), STANDSTILL),
        (Twist2(0.0, 0.0, math.nan), STANDSTILL),
    ],
)
def test_while_sight_is_stale_a_fast_robot_stops_and_a_slow_one_stays_slow(measured: Twist2, limit: SpeedLimit) -> None:
    now = replace(WELL, prediction=replace(FREE_WAY, measured=measured, reach_m=0.5))
    for age_s in (0.0, SIGHT_STALE_S):
        assert stale_sight_limit(replace(now, sight_age_s=age_s), PARAMS) is None
    for age_s in (SIGHT_STALE_S + 1e-6, 1.0, math.inf, math.nan):
        assert stale_sight_limit(replace(now, sight_age_s=age_s), PARAMS) == limit


def test_without_obstacles_sight_is_never_stale() -> None:
    blind = replace(WELL, sight_age_s=math.inf, prediction=None)
    assert stale_sight_limit(blind, PARAMS) is None
    rows = tuple(code for code in PARAMS.rows if code != "OBSTACLES_TIMEOUT")
    late = replace(WELL, sight_age_s=1.0)
    assert stale_sight_limit(late, PARAMS.model_copy(update={"rows": rows})) is None
