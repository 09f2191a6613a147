"""From the process table to running, healthy processes.

profile     which processes run together, and with which parameters
lifecycle   when one process is started, judged hung, restarted or given up (pure)
fleet       the operating-system processes, forked from a preloaded server
orphans     what an earlier, killed supervisor left behind
segments    shared memory of killed processes
control     the socket that ``robot-stack status``, ``down`` and ``restart`` ask
"""
