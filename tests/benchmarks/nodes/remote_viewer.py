"""A viewer behind a slow link.

    python -m tests.benchmarks.nodes.remote_viewer SETTLE_S FOR_S

Prints "ready" once it receives, and then the rate of each viewed topic, 1/s of the robot's time, as JSON.
"""

from __future__ import annotations

import json
import sys

from robot_stack.contract import topics
from robot_stack.system_monitor.nodes.topic_meter import Meter
from tests.benchmarks.remote import VIEWED


def main(settle_s: float, for_s: float) -> None:
    with Meter([*VIEWED, topics.CLOCK]) as meter:
        meter.settle(settle_s)
        print("ready", flush=True)
        meter.run(for_s)
        print(json.dumps({name: seen.traffic.rate_hz for name, seen in meter.seen().items()}))


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]))
