"""Heavy data for the pages that show it: encoded when a page is ready for the next, at most at its drawing rate."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from robot_stack.contract import topics
from robot_stack.core.jpeg import grey_jpeg
from robot_stack.middleware.conversions import pose_from_msg
from robot_stack.middleware.image import grey_image
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import points_of
from robot_stack.middleware.wire import CloudView, ImageView
from robot_stack.ui import frames
from robot_stack.ui.nodes.inputs import RobotInputs
from robot_stack.ui.params import PagesParams
from robot_stack.ui.protocol import Layer

_XY = np.dtype([("x", "<f4"), ("y", "<f4")])


class Layers:
    """wanted: layers whose next frame a page waits for. send: sends a frame."""

    def __init__(
        self,
        node: StackNode,
        params: PagesParams,
        wanted: Callable[[], frozenset[Layer]],
        send: Callable[[Layer, bytes], None],
    ) -> None:
        self._node, self._params, self._wanted, self._send = node, params, wanted, send
        self._sent_s: dict[Layer, float] = {}
        self.inputs: RobotInputs | None = None
        self.callbacks: dict[str, Callable[[Any], None]] = {
            topics.LOCAL_COSTMAP.name: self._on_costmap,
            topics.OBSTACLES.name: self._on_obstacles,
            topics.FRONT_IMAGE.name: partial(self._on_image, Layer.FRONT_IMAGE),
            topics.REAR_IMAGE.name: partial(self._on_image, Layer.REAR_IMAGE),
        }

    def _due(self, layer: Layer, rate_hz: float) -> bool:
        now_s = self._node.steady_s()
        since_s = now_s - self._sent_s.get(layer, -math.inf)
        if layer not in self._wanted() or 0.0 <= since_s < 1.0 / rate_hz:
            return False
        self._sent_s[layer] = now_s
        return True

    def _on_costmap(self, message: Any) -> None:
        odom = self.inputs.odom_in_map() if self.inputs else None
        if odom is None or not self._due(Layer.COSTMAP, self._params.cloud_hz):
            return
        info = message.info
        costs = np.asarray(message.data, np.int8).reshape(info.height, info.width)
        corner = odom.compose(pose_from_msg(info.origin))
        self._send(Layer.COSTMAP, frames.costmap(costs, info.resolution, corner))

    def _on_obstacles(self, message: CloudView) -> None:
        base = self.inputs.pose() if self.inputs else None
        if base is None or not self._due(Layer.OBSTACLES, self._params.cloud_hz):
            return
        try:
            points = points_of(message, _XY)
        except ValueError as error:
            self._node.report.values["obstacles"] = str(error)
            return
        xy = np.column_stack((points["x"], points["y"]))
        self._send(Layer.OBSTACLES, frames.obstacles(xy, base, self._params.cloud_points_max))

    def _on_image(self, layer: Layer, message: ImageView) -> None:
        if not self._due(layer, self._params.image_hz):
            return
        try:
            jpeg = grey_jpeg(grey_image(message), self._params.image_width_px, self._params.jpeg_quality)
        except ValueError as error:
            self._node.report.values[layer.value] = str(error)
            return
        self._send(layer, frames.image(layer, jpeg))
