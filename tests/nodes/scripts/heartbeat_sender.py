"""Beats on the record of one process of the contract until it is killed. Usage: heartbeat_sender.py NAME."""

from __future__ import annotations

import sys
import time

from robot_stack.core.node_record import NodeRecord


def main() -> None:
    record = NodeRecord(sys.argv[1])
    while True:
        record.beat(True, "")
        time.sleep(0.1)


if __name__ == "__main__":
    main()
