"""Safety: faults as rows, one arbiter, an emergency stop that only two keys release.

``monitor`` combines the pure parts; ``nodes`` are the processes around it.
"""
