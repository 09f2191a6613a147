"""A viewer behind a slow link.

    python -m tests.benchmarks.nodes.remote_viewer SETTLE_S FOR_S

Prints the rate of each viewed topic, 1/s of the robot's time, as JSON.
"""

from __future__ import annotations

import json
import sys
import time

from robot_stack.contract import topics
from robot_stack.system_monitor.nodes.topic_meter import Meter
from tests.benchmarks.remote import VIEWED


def main(settle_s: float, for_s: float) -> None:
    end_s = time.monotonic() + settle_s
    with Meter([*VIEWED, topics.CLOCK]) as meter:
        meter.settle(settle_s)
        time.sleep(max(0.0, end_s - time.monotonic()))
        meter.run(for_s)
        print(json.dumps({name: seen.traffic.rate_hz for name, seen in meter.seen().items()}))


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]))
