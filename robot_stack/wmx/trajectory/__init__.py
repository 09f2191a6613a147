"""Joint trajectories on the motion engine: goals checked, timed, executed as one spline, watched to standstill."""
