"""Safety: the referee of the ride. Faults as rows, one arbiter, an emergency stop that only two keys release.

``monitor`` ties the pure parts together; ``nodes`` are the processes around it.
"""
