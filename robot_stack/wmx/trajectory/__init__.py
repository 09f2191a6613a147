"""Joint trajectories on the motion engine: goals are checked, timed, executed as one spline, and monitored to rest."""
