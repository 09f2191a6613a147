"""Starts and supervises the processes of the process table.

profile     selects the processes and their parameters
lifecycle   decides when a process is started, counts as hung, is restarted or given up (pure)
fleet       the operating-system processes, forked from a preloaded server
orphans     processes left by an earlier, killed supervisor
segments    shared memory of killed processes
control     the socket used by ``robot-stack status``, ``down`` and ``restart``
"""
