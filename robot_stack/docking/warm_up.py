"""Compiles or loads the kernels of marker detection before the first image instead of during it."""

from __future__ import annotations

from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.docking.vision.detector import MarkerDetector
from robot_stack.docking.vision.params import ArucoDetectorParams


def warm_up() -> None:
    """One marker."""
    MarkerDetector(load_docks(), load(ArucoDetectorParams, "aruco_detector").detector).warm_up()
