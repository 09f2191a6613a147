"""The joint outside of its tolerance, and its deviation."""

from __future__ import annotations

import numpy as np

from robot_stack.wmx.trajectory.tolerances import Tolerances, violation

JOINTS = ("a", "b")


def test_the_joint_that_is_furthest_out_is_named() -> None:
    tolerances = Tolerances(np.array([0.1, 0.01]), np.array([np.inf, 1.0]))
    assert violation(tolerances, np.array([0.1, -0.01]), np.array([9.0, 1.0]), JOINTS) == ""
    text = violation(tolerances, np.array([0.2, -0.03]), np.zeros(2), JOINTS)
    assert text == "b: position error -0.03000 rad, tolerance 0.01 rad"
    assert violation(tolerances, np.zeros(2), np.array([99.0, 2.0]), JOINTS).startswith(
        "b: velocity error +2.00000 rad/s"
    )


def test_no_limit_is_never_violated() -> None:
    assert violation(Tolerances.none(2), np.array([1e9, 0.0]), np.array([1e9, 0.0]), JOINTS) == ""
