"""A node process for the supervisor's tests, in a profile's ``extra``. A file selects its misbehaviour.

The folder ``SUPERVISED_ORDERS`` holds one file for each process, named like it, with one word in it: hang (the node's
loop blocks), stubborn (the same, and it ignores SIGINT and SIGTERM), crash (exit code 1), refuse (exit code 2), waiting
(not ready), locked (hangs at its end, holding the interpreter lock). A restarted process reads it again.
While the file ``SUPERVISED_IMPORT`` exists, the import of this module does not end.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from robot_stack.middleware.node import StackNode
from robot_stack.ros.process import run_nodes

while Path(os.environ.get("SUPERVISED_IMPORT", os.devnull)).is_file():
    time.sleep(0.02)


class Supervised(StackNode):
    def __init__(self) -> None:
        name = Path(sys.argv[0]).name
        super().__init__(name)
        self._orders = Path(os.environ["SUPERVISED_ORDERS"]) / name
        self._helper: subprocess.Popen[bytes] | None = None
        self.every(50.0, self._obey)
        self._obey()

    def _obey(self) -> None:
        order = self._order()
        self.set_health(order != "waiting", "working" if order != "waiting" else "/sensors/imu")
        match order:
            case "crash":
                os._exit(1)
            case "refuse":
                os._exit(2)
            case "child" if self._helper is None:
                self._helper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
            case "hang":
                _stand_still()
            case "stubborn":
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                signal.signal(signal.SIGTERM, signal.SIG_IGN)
                _stand_still()

    def _order(self) -> str:
        return self._orders.read_text(encoding="ascii").strip() if self._orders.exists() else ""

    def destroy_node(self) -> None:
        if self._order() == "locked":
            ctypes.PyDLL(None).sleep(600)
        super().destroy_node()


def _stand_still() -> None:
    while True:
        time.sleep(1.0)


def main() -> None:
    raise SystemExit(run_nodes(Supervised))
