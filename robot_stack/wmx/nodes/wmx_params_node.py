"""wmx_params_node: parameters of the motion engine as services: a file loaded, the parameters of axes shown."""

from __future__ import annotations

from typing import Any

from robot_stack.contract import services
from robot_stack.ros.node import run
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.nodes.service_node import ServiceNode, fill
from robot_stack.wmx.services.parameter_sets import load_file, show


class WmxParamsNode(ServiceNode):
    """Loads for everybody who uses the engine; a node's own parameter file may replace what was loaded."""

    def __init__(self) -> None:
        super().__init__("wmx_params_node")
        self.offer(services.PARAMS_LOAD, "Failed to load parameters", _load)
        self.offer(services.PARAMS_GET, "Failed to get parameters", _get)


def _load(engine: MotionEngine, request: Any, response: Any) -> None:
    fill(response, load_file(engine, request.file_path))


def _get(engine: MotionEngine, request: Any, response: Any) -> None:
    read = show(engine, request.index)
    fill(response, read.answer)
    response.params_dump = list(read.texts)


def main() -> None:
    run(WmxParamsNode)


if __name__ == "__main__":
    main()
