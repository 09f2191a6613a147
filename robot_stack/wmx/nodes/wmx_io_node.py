"""wmx_io_node: digital inputs and outputs of the motion engine as services."""

from __future__ import annotations

from typing import Any

from robot_stack.contract import services
from robot_stack.contract.model import Service
from robot_stack.ros.node import run
from robot_stack.wmx import MotionEngine
from robot_stack.wmx.general.answers import Answer
from robot_stack.wmx.nodes.service_node import ServiceNode, fill
from robot_stack.wmx.services.digital_io import Image, read_bit, read_bytes, write_bit, write_bytes


class WmxIoNode(ServiceNode):
    """Reads always. Writes nothing while an emergency stop is in force: an output may move something."""

    def __init__(self) -> None:
        super().__init__("wmx_io_node")
        for image, bit_row, bytes_row in _READS:
            self.offer(bit_row, f"Failed to read {image} bit", _bit_reader(image))
            self.offer(bytes_row, f"Failed to read {image} bytes", _bytes_reader(image))
        self.offer(services.IO_SET_OUTPUT_BIT, "Failed to set output bit", self._set_bit)
        self.offer(services.IO_SET_OUTPUT_BYTES, "Failed to set output bytes", self._set_bytes)

    def _set_bit(self, engine: MotionEngine, request: Any, response: Any) -> None:
        if self.emergency_stop:
            fill(response, _STOPPED)
        else:
            fill(response, write_bit(engine.io, request.byte, request.bit, request.value))

    def _set_bytes(self, engine: MotionEngine, request: Any, response: Any) -> None:
        if self.emergency_stop:
            fill(response, _STOPPED)
        else:
            fill(response, write_bytes(engine.io, request.byte, bytes(request.data)))


_STOPPED = Answer(False, "Failed to set outputs: /emergency_stop is in force")
_READS: tuple[tuple[Image, Service, Service], ...] = (
    ("input", services.IO_GET_INPUT_BIT, services.IO_GET_INPUT_BYTES),
    ("output", services.IO_GET_OUTPUT_BIT, services.IO_GET_OUTPUT_BYTES),
)


def _bit_reader(image: Image) -> Any:
    def serve(engine: MotionEngine, request: Any, response: Any) -> None:
        read = read_bit(engine.io, image, request.byte, request.bit)
        fill(response, read.answer)
        response.value = read.value

    return serve


def _bytes_reader(image: Image) -> Any:
    def serve(engine: MotionEngine, request: Any, response: Any) -> None:
        read = read_bytes(engine.io, image, request.byte, request.length)
        fill(response, read.answer)
        response.data = read.data

    return serve


def main() -> None:
    run(WmxIoNode)


if __name__ == "__main__":
    main()
