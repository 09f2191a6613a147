"""One line of /docking/status."""

from __future__ import annotations

import math

from robot_stack.docking.tools.status_line import describe, silent


def test_status_line_contains_known_values():
    assert describe("FINE_ALIGN", 0.0031, 0.007, 4, 0.954) == "FINE_ALIGN, 3.1 mm, +0.40 deg, 4 markers, 95%"
    assert describe("SERVOING", 0.5, -0.1, 1, 0.0) == "SERVOING, 500.0 mm, -5.73 deg, 1 marker, 0%"
    assert describe("SEARCH", math.inf, math.nan, 0, math.nan) == "SEARCH, 0 markers"
    assert silent(3.2) == "no /docking/status for 3 s"
