"""The smallest node of the stack: named like the navigation controller, it commands 1 m/s while this is permitted."""

import argparse
import sys

from geometry_msgs.msg import Twist

from robot_stack.contract import topics
from robot_stack.middleware.node import StackNode
from robot_stack.ros.process import run_nodes

parser = argparse.ArgumentParser()
parser.add_argument("--crash-after", type=int, default=0)
parser.add_argument("--advertise", default="CMD_VEL")
parser.add_argument("--listen", default="")
options, rest = parser.parse_known_args()
sys.argv[1:] = rest


class ExampleNode(StackNode):
    def __init__(self) -> None:
        super().__init__("navigation_controller")
        self._cmd_vel = self.advertise(topics.ROWS[options.advertise])
        if options.listen:
            self.listen(topics.ROWS[options.listen], lambda *_: None)
        self._ticks = 0
        self.every(20.0, self._tick)

    def _tick(self) -> None:
        self._ticks += 1
        self.set_health(True, "driving")
        self._publish(0.0 if self.emergency_stop else 1.0)
        if 0 < options.crash_after <= self._ticks and self._cmd_vel.get_subscription_count():
            raise ZeroDivisionError("asked for by the test")

    def on_emergency_stop(self) -> None:
        self._publish(0.0)

    def safe_output(self) -> None:
        self._publish(0.0)

    def _publish(self, speed_mps: float) -> None:
        message = Twist()
        message.linear.x = speed_mps
        self._cmd_vel.publish(message)


sys.exit(run_nodes(ExampleNode))
