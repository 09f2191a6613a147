"""The detector of markers as a process: an image over DDS in, an array out. When it detects: tests/simulated/nodes."""

from __future__ import annotations

from collections.abc import Callable

from robot_stack.contract import topics
from robot_stack.docking.warm_up import warm_up
from tests.simulated.nodes.test_aruco_detector import PICTURES, ids, image, info
from tests.support.peer import Peer
from tests.support.processes import NodeProcess


def test_markers_of_an_image_come_over_dds(start: Callable[..., NodeProcess], peer: Peer) -> None:
    warm_up()  # what the node compiles at its first start on a machine takes longer than a test may wait
    arrays = peer.listen(topics.ARUCO_DETECTIONS)
    node = start("aruco_detector", "-p", "always_on:=true")
    peer.repeat(topics.FRONT_CAMERA_INFO, info, 10.0)
    clock = peer.node.get_clock()
    peer.repeat(topics.FRONT_IMAGE, lambda: image("front", PICTURES["front"], 1e-9 * clock.now().nanoseconds), 10.0)
    arrays.wait(lambda message: ids(message) == [0, 1, 2, 3], "the front camera's markers")
    node.stop()
    assert node.process.returncode == 0
