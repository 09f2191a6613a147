"""Metrics of a ride, compared with values computed by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from robot_stack.core.geometry import Pose2
from sim.pictures.ride_plots import draw_course, draw_map
from sim.run.ride import (
    Ride,
    Sample,
    Step,
    arrivals,
    carriage,
    distance_m,
    distance_to_line_m,
    estimate_errors,
    figures,
    stops,
    tracking_errors_m,
)
from sim.worldfile import load_world

LINE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])


def along_x(*points: tuple[float, float, float]) -> list[Sample]:
    """Samples (time, x, y) at 1 m/s, heading east."""
    return [Sample(time_s, Pose2(x, y, 0.0), 1.0) for time_s, x, y in points]


@pytest.mark.parametrize(
    ("point", "distance"),
    [((2.0, 0.5), 0.5), ((-3.0, 4.0), 5.0), ((4.0, 1.0), 0.0), ((4.0, 5.0), 2.0), ((3.0, 2.0), 1.0)],
)
def test_distance_to_a_line(point: tuple[float, float], distance: float) -> None:
    assert distance_to_line_m(np.array(point), LINE) == pytest.approx(distance)
    repeated = np.array([[1.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    assert distance_to_line_m(np.array([1.5, 3.0]), repeated) == pytest.approx(2.0)


def test_a_belief_is_compared_with_the_truth_of_its_own_time() -> None:
    ride = Ride(
        along_x((0.0, 0, 0), (1.0, 1, 0)), [(-0.1, Pose2(9, 9, 9)), (0.5, Pose2(0.5, 0.1, 0.2)), (1.1, Pose2(0, 0, 0))]
    )
    errors = estimate_errors(ride)
    assert errors.shape == (1, 3)  # no truth before the first and after the last sample
    assert errors[0] == pytest.approx([0.5, 0.1, 0.2])


def test_errors_are_against_the_plan_in_force() -> None:
    north = np.array([[0.0, 2.0], [10.0, 2.0]])
    ride = Ride(along_x((0.0, 0, 0.1), (1.0, 1, 0.2), (5.0, 5, 2.3), (6.0, 6, 2.4)), [], [(0.5, LINE), (5.0, north)])
    errors = tracking_errors_m(ride)
    assert errors[:, 0].tolist() == [1.0, 5.0, 6.0]  # the first sample had no plan yet
    assert errors[:, 1] == pytest.approx([0.2, 0.3, 0.4])
    ahead = np.array([[1.0, 0.0], [9.0, 0.0]])
    ride = Ride(along_x((1.0, 0.5, 0.0), (1.6, 0.9, 0.0)), [], [(0.0, LINE), (1.0, ahead)])
    assert tracking_errors_m(ride)[:, 1] == pytest.approx([0.0, 0.1]), "the old one until the new one is reached"
    cancelled = Ride(along_x((1.0, 0, 0)), [], [(0.0, LINE), (0.5, np.empty((0, 2)))])
    assert tracking_errors_m(cancelled).shape == (0, 2)


def test_figures() -> None:
    ride = Ride(along_x((10.0, 0, 0), (12.0, 2, 0.3), (14.0, 4, -0.4)), [], [(0.0, LINE)])
    found = figures(ride, Pose2(4.0, 0.0, math.radians(-359.0)))
    assert found.distance_m == pytest.approx(math.hypot(2, 0.3) + math.hypot(2, 0.7))
    assert found.time_s == pytest.approx(4.0)
    assert found.top_speed_mps == 1.0
    assert found.final_error_m == pytest.approx(0.4)
    assert found.final_error_deg == pytest.approx(1.0)
    assert found.tracking_rms_m == pytest.approx(math.sqrt((0.09 + 0.16) / 3.0))
    assert found.tracking_max_m == pytest.approx(0.4)
    assert math.isnan(figures(Ride(along_x((0, 0, 0))), Pose2(0.0, 0.0, 0.0)).tracking_rms_m), "without a plan"
    with pytest.raises(ValueError, match="recorded no data"):
        figures(Ride(), Pose2(0.0, 0.0, 0.0))
    assert distance_m([]) == 0.0


def test_plots_are_drawn(tmp_path: Path) -> None:
    ride = Ride(along_x((0.0, 0, 0), (1.0, 1, 0.1)), [], [(0.0, np.empty((0, 2))), (0.5, LINE)])
    draw_map(tmp_path / "map.png", load_world("yard"), ride, [("goal", Pose2(4.0, 3.0, 0.0))])
    draw_course(tmp_path / "course.png", ride)
    for name in ("map.png", "course.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_carriage_reports_docking_offset_and_transport_of_wheelchair() -> None:
    dock_pose = Pose2(-0.95, 0.0, 0.0)
    ride = Ride(
        [Sample(0.0, Pose2(0.0, 0.0, 0.0), 0.0), Sample(10.0, Pose2(1.052, 0.0, 0.0), 0.0)],
        wheelchair=[(0.0, Pose2(2.0, 0.0, 0.0)), (10.0, Pose2(2.0, 0.0, 0.0)), (20.0, Pose2(5.0, 0.1, 0.0))],
        docking=[(9.0, "FINE_ALIGN"), (10.0, "DOCKED"), (19.0, "IDLE")],
    )
    found = carriage(ride, dock_pose, Pose2(4.05, 0.0, 0.0))
    assert found is not None
    assert found.docked_mm == pytest.approx(2.0)
    assert found.carried_m == pytest.approx(math.hypot(3.0, 0.1))
    assert found.beside_m == pytest.approx(0.1)
    assert carriage(Ride(), dock_pose, None) is None
    never = carriage(Ride(wheelchair=ride.wheelchair), dock_pose, None)
    assert never is not None
    assert math.isnan(never.docked_mm)


def driven(*speeds: tuple[float, float]) -> list[Sample]:
    """Samples from (time s, speed m/s) along x, 1 m apart."""
    return [Sample(time_s, Pose2(float(x), 0.0, 0.0), speed) for x, (time_s, speed) in enumerate(speeds)]


def test_where_it_stood_and_why() -> None:
    ride = Ride(
        driven(
            *((0, 0.5), (1, 0.0), (2, 0.0), (4, 0.0), (5, 0.5), (6, 0.0), (7, 0.5)),
            *((8, 0), (12, 0), (13, 1), (14, 0), (20, 0)),
        ),
        steps=[
            Step(0.0, "RUNNING", "gate"),
            Step(0.9, "WAITING", "gate", "waiting 3 s"),
            Step(4.5, "RUNNING", "chair"),
            Step(13.5, "COMPLETED", "chair", "done"),
        ],
        docking=[(0.0, "IDLE"), (7.5, "SERVOING"), (10.0, "FINE_ALIGN"), (12.5, "DOCKED")],
        limits=[(0.0, 1.5, ""), (13.9, 0.0, "OBSTACLE_NEAR"), (15.0, 0.0, "LIDAR_TIMEOUT"), (16.0, 1.0, "")],
    )
    found = stops(ride, 0.05, 2.0)
    assert [(stop.time_s, stop.duration_s, stop.pose.x) for stop in found] == [(1, 3, 1.0), (8, 4, 7.0), (14, 6, 10.0)]
    assert [stop.why for stop in found] == [
        "waiting 3 s",
        "docking: SERVOING -> FINE_ALIGN",
        "stopped: OBSTACLE_NEAR, LIDAR_TIMEOUT",
    ]


def test_reason_of_stop_is_taken_from_limits_and_mission_steps() -> None:
    ride = Ride(driven((0, 0.0), (3, 0.0)))
    assert [stop.why for stop in stops(ride, 0.05, 2.0)] == [""]
    ride.steps = [Step(0.0, "PAUSED", "gate")]
    ride.limits = [(1.0, 0.0, "")]
    assert [stop.why for stop in stops(ride, 0.05, 2.0)] == ["stopped: no reason given"]
    ride.limits = []
    assert [stop.why for stop in stops(ride, 0.05, 2.0)] == ["paused at gate"]
    ride.steps = [Step(0.0, "RUNNING", "gate"), Step(1.0, "WAITING", "gate"), Step(2.0, "RUNNING", "end")]
    assert [stop.why for stop in stops(ride, 0.05, 2.0)] == ["waiting at gate"]
    assert stops(Ride(), 0.05, 2.0) == []


def test_when_it_had_been_where() -> None:
    steps = [Step(0.0, "RUNNING", "gate"), Step(4.0, "RUNNING", "bench"), Step(6.0, "WAITING", "bench")]
    assert arrivals(steps) == [("gate", 4.0)]
    assert arrivals([*steps, Step(9.0, "COMPLETED", "bench")]) == [("gate", 4.0), ("bench", 9.0)]
    assert arrivals([*steps, Step(9.0, "COMPLETED", "")]) == [("gate", 4.0), ("bench", 9.0)]
    assert arrivals([]) == []
