"""The contract: every topic, service, action, process and fault of the stack, one row each, and nothing else.

Endpoints, timers, time-outs, the recorder's list, the rate monitor and ``docs/interfaces.md`` are read from here.
"""
