"""Poses from relative measurements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.mapping.pose_graph import Edges, Levels, errors, solve
from robot_stack.mapping.poses import difference, from_angles, inverse, moved, planar, pose_of

FIRM = np.full((1, 6), 1e4)


def edges(first, second, measured, deviation=0.01, robust=np.inf) -> Edges:
    weight = np.full((len(first), 6), 1.0 / deviation)
    return Edges(np.array(first), np.array(second), np.array(measured), weight, robust)


def test_a_loop_spreads_its_error_evenly():
    """Four steps of 1 m on a line, and a measurement of 4.2 m for the end: each edge takes a fifth of 0.2 m."""
    anchor = Edges(np.array([-1]), np.array([0]), np.eye(4)[None], FIRM)
    chain = edges(range(4), range(1, 5), [planar(1.0, 0.0, 0.0)] * 4)
    loop = edges([0], [4], [planar(4.2, 0.0, 0.0)])
    start = np.array([planar(float(k), 0.0, 0.0) for k in range(5)])
    found = solve(start, [anchor, chain, loop], Levels())
    np.testing.assert_allclose(found[:, 0, 3], [0.0, 1.04, 2.08, 3.12, 4.16], atol=1e-6)
    assert errors(found, loop)[0, 0] == pytest.approx(-0.04, abs=1e-6)


def test_robust_kernel_suppresses_wrong_loop_closure():
    anchor = Edges(np.array([-1]), np.array([0]), np.eye(4)[None], FIRM)
    chain = edges(range(4), range(1, 5), [planar(1.0, 0.0, 0.0)] * 4)
    wrong = edges([0], [4], [planar(0.0, 3.0, 1.0)], robust=3.0)
    start = np.array([planar(float(k), 0.0, 0.0) for k in range(5)])
    held = solve(start, [anchor, chain, wrong], Levels())
    bent = solve(start, [anchor, chain, edges([0], [4], [planar(0.0, 3.0, 1.0)])], Levels())
    assert np.abs(held[4, :3, 3] - [4.0, 0.0, 0.0]).max() < 0.2
    assert np.abs(bent[4, :3, 3] - [4.0, 0.0, 0.0]).max() > 1.0


def test_the_horizon_levels_a_pose():
    """Up is tilted by 3 deg from z towards the side in the pose's frame, so the pose rolls by 3 deg."""
    roll = math.radians(3.0)
    wanted = from_angles(np.array([roll]), np.zeros(1), np.zeros(1))
    anchor = Edges(np.array([-1]), np.array([0]), np.eye(4)[None], np.array([[1e4, 1e4, 1e4, 1e-3, 1e-3, 1e4]]))
    found = solve(np.eye(4)[None], [anchor], Levels(np.array([0]), wanted[:, 2, :], 100.0))
    np.testing.assert_allclose(found[0, :3, :3], wanted[0], atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_true_steps_bring_back_the_truth(seed):
    random = np.random.default_rng(seed)
    angles = random.uniform(-0.3, 0.3, (3, 6))
    truth = pose_of(random.uniform(-5.0, 5.0, (6, 3)), from_angles(*angles))
    truth[0] = np.eye(4)
    anchor = Edges(np.array([-1]), np.array([0]), np.eye(4)[None], FIRM)
    pairs = np.array([(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (0, 5)])
    chain = edges(pairs[:, 0], pairs[:, 1], inverse(truth[pairs[:, 0]]) @ truth[pairs[:, 1]])
    found = solve(moved(truth, random.normal(0.0, 0.1, (6, 6))), [anchor, chain], Levels())
    assert np.abs(difference(found, truth)).max() < 1e-5
