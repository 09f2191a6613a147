"""wmx_ethercat_node: the EtherCAT network of the motion engine as services."""

from __future__ import annotations

from typing import Any

from robot_stack.contract import services
from robot_stack.ros.node import run
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.nodes.service_node import ServiceNode, fill
from robot_stack.wmx.services.ethercat import network_state, read_registers, reset_statistics, start_hotconnect


class WmxEthercatNode(ServiceNode):
    """Looks at the network; of what it can change nothing moves an axis."""

    def __init__(self) -> None:
        super().__init__("wmx_ethercat_node")
        self.offer(services.ECAT_GET_NETWORK_STATE, "Failed to get network state", _get_network_state)
        self.offer(services.ECAT_REGISTER_READ, "Failed to read registers", _register_read)
        self.offer(services.ECAT_RESET_STATISTICS, "Failed to reset statistics", _reset_statistics)
        self.offer(services.ECAT_START_HOTCONNECT, "Failed to start hot connect", _start_hotconnect)


def _get_network_state(engine: MotionEngine, request: Any, response: Any) -> None:
    state = network_state(engine.ecat, request.master_id)
    fill(response, state.answer)
    for name, value in (state.master | state.slaves).items():
        setattr(response, name, value)


def _register_read(engine: MotionEngine, request: Any, response: Any) -> None:
    read = read_registers(engine.ecat, request.master_id, request.slave_id, request.reg_address, request.length)
    fill(response, read.answer)
    response.data = read.data


def _reset_statistics(engine: MotionEngine, request: Any, response: Any) -> None:
    fill(response, reset_statistics(engine.ecat, request.master_id))


def _start_hotconnect(engine: MotionEngine, request: Any, response: Any) -> None:
    fill(response, start_hotconnect(engine.ecat, request.master_id))


def main() -> None:
    run(WmxEthercatNode)


if __name__ == "__main__":
    main()
