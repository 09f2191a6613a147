"""Node remote_view: thinned clouds and compressed images, only while they have subscribers."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import Any

import cv2
from sensor_msgs.msg import CompressedImage, PointCloud2

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.jpeg import grey_jpeg
from robot_stack.core.point_cloud import XYZ
from robot_stack.middleware.image import grey_image
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import cloud_message, points_of
from robot_stack.middleware.wire import CloudView, ImageView
from robot_stack.view.remote_params import RemoteViewParams
from robot_stack.view.thinning import thinned


class _Copy:
    """One output. Its input is subscribed to only while the output has subscribers.

    convert: the output's message of an input's; raises ValueError for one that cannot be read.
    """

    def __init__(self, node: StackNode, source: Topic, output: Topic, convert: Callable[[Any], Any]) -> None:
        self._node, self._source, self._convert = node, source, convert
        self.name = output.name
        self._publisher = node.advertise(output)
        self._input: Input | None = None
        self._converted = 0
        self.problem = ""

    @property
    def is_watched(self) -> bool:
        return self._input is not None

    def tick(self) -> None:
        """Publishes the newest message of the input, if it is new."""
        if not self._publisher.get_subscription_count():
            self._end()
            return
        if self._input is None:
            self._input, self._converted = self._node.subscribe(self._source), 0
        if self._input.received == self._converted:
            self.problem = "" if self._input.fresh() else f"waiting for {self._source.name}"
            return
        self._converted = self._input.received
        try:
            self._publisher.publish(self._convert(self._input.latest))
            self.problem = ""
        except ValueError as error:
            self.problem = f"{self._source.name}: {error}"

    def _end(self) -> None:
        if self._input is not None:
            self._node.unsubscribe(self._input)
        self._input, self.problem = None, ""


class RemoteViewNode(StackNode, bulk=True):
    """Converts at the contract's rate, whatever the rates of sweeps and images."""

    def __init__(self) -> None:
        super().__init__("remote_view", RemoteViewParams)
        cv2.setNumThreads(1)  # the other cores have work
        images = {topics.FRONT_IMAGE: topics.REMOTE_FRONT_IMAGE, topics.REAR_IMAGE: topics.REMOTE_REAR_IMAGE}
        self._copies = [_Copy(self, topics.LIDAR_POINTS, topics.REMOTE_POINTS, self._cloud)]
        self._copies += [_Copy(self, source, output, self._image) for source, output in images.items()]
        self.set_health(True, "no viewer")
        self.every(topics.REMOTE_POINTS.nominal_rate_hz, self._convert)

    def _convert(self) -> None:
        for copy in self._copies:
            copy.tick()
        watched = ", ".join(copy.name for copy in self._copies if copy.is_watched)
        problems = [copy.problem for copy in self._copies if copy.problem]
        self.set_health(not problems, "; ".join(problems) or (f"publishing {watched}" if watched else "no viewer"))

    def _cloud(self, message: CloudView) -> PointCloud2:
        output = cloud_message(thinned(points_of(message, XYZ), self.params.cloud), message.header.frame_id)
        output.header.stamp = message.header.stamp
        return output

    def _image(self, message: ImageView) -> CompressedImage:
        jpeg = grey_jpeg(grey_image(message), self.params.image.width_px, self.params.image.jpeg_quality)
        # As image_transport's compressed transport describes a grey image.
        output = CompressedImage(header=message.header, format="mono8; jpeg compressed ")
        output.data = array("B", jpeg)
        return output
