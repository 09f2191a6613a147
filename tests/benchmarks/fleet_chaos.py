"""Fleet orders in virtual time while messages, the broker, the agent and the clocks fail: all of them must end."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tests.benchmarks.support.framework import Aim, Result
from tests.support.fleet.chaos import Counts, seeds_that_fail
from tests.support.fleet.real_chaos import real_ride

AIMS = {"failed": Aim("<=", 0), "slowest_recovery_s": Aim("<=", 5.0), "real_orders_wrong": Aim("<=", 0)}


def run(seeds: int = 200, first: int = 0, real: int = 0) -> Result:
    """One ride of four orders for each seed, with 30 % of the messages lost and the others up to 2 s late, some 60 s.

    failed: rides with an order that was lost or driven twice, or with a state that was still wrong 5 s after a
    recovery; the conditions name them. kills, outages: of the agent, and of the broker. slowest_recovery_s: from the
    end of the faults to a right state.

    real: number of kills of mosquitto and of the agent's process each, in real time, 3 s for each; 0 for none.
    real_orders_wrong: lost or driven twice. real_recovery_s: the longest from a kill to the next state.
    """
    rides: list[Counts] = []
    failed = seeds_that_fail(range(first, first + seeds), lambda _, counts: rides.append(counts))
    figures = {
        "failed": float(len(failed)),
        "kills": float(sum(ride.kills for ride in rides)),
        "outages": float(sum(ride.outages for ride in rides)),
        "messages_lost": float(sum(ride.lost for ride in rides)),
        "recoveries": float(sum(ride.recoveries for ride in rides)),
        "slowest_recovery_s": max((ride.slowest_s for ride in rides), default=0.0),
        "virtual_h": sum(ride.duration_s for ride in rides) / 3600.0,
    }
    conditions = {"seeds": f"{first} to {first + seeds - 1}", "failures": failed}
    if real:
        with tempfile.TemporaryDirectory() as folder:
            counts = real_ride(Path(folder), real, real, first)
        figures |= {
            "real_kills": float(counts.broker_kills + counts.agent_kills),
            "real_orders": float(counts.orders),
            "real_orders_wrong": float(len(counts.problems)),
            "real_recovery_s": counts.slowest_recovery_s,
        }
        conditions["real_failures"] = counts.problems
    return Result(figures, conditions)
