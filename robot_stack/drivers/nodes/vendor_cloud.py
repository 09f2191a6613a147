"""Shared part of the adapters of both LiDARs: converts another vendor's cloud to the contract's, reports silence."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from sensor_msgs.msg import PointCloud2

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.point_cloud import SWEEP
from robot_stack.drivers.nodes.mounting import mounting
from robot_stack.drivers.point_cloud.adapter import PointCloudAdapter, Sweep
from robot_stack.drivers.point_cloud.cloud import Cloud, CloudRefused, Field
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.point_cloud import cloud_message, fill
from robot_stack.middleware.wire import CloudView
from tf2_msgs.msg import TFMessage


class VendorCloudNode(StackNode, bulk=True):
    """sensor: of ``config/robot.yaml``, also its frame. vendor, points: the rows of its subscription and publisher."""

    sensor: ClassVar[str]
    vendor: ClassVar[Topic]
    points: ClassVar[Topic]

    def __init__(self, name: str, parameters: type[PointCloudAdapterParams]) -> None:
        super().__init__(name, parameters)
        sensor = self.robot.range_sensors[self.sensor]
        self._adapter = PointCloudAdapter(
            self.params, sensor.period_s, sensor.rings, self.robot.to_sensor_frame(self.sensor)
        )
        self._message = cloud_message(np.empty(0, SWEEP), self.sensor)
        self._sweeps = self.advertise(self.points)
        self._tf = self.advertise(topics.TF_STATIC)
        place = mounting(self.sensor, sensor.xyz_m, self.robot.sensor_frame(self.sensor), self.stamp())
        self._tf.publish(TFMessage(transforms=[place]))
        self._clouds = self.subscribe(self.vendor, self._on_cloud, self.params.topic)
        self.report.values["device"] = f"{self.params.topic} of another driver"
        self.set_health(False, f"waiting for {self.params.topic}")
        self.every(1.0 / self.params.silence_s, self._watch)

    def _on_cloud(self, message: PointCloud2 | CloudView) -> None:
        try:
            sweep = self._adapter.convert(_cloud_of(message), self.now_s())
        except CloudRefused as refusal:
            self.get_logger().warning(f"{self.params.topic} refused: {refusal}", throttle_duration_sec=5.0)
            self.set_health(False, f"{self.params.topic} refused: {refusal}")
            return
        self._publish(sweep)

    def _publish(self, sweep: Sweep) -> None:
        fill(self._message, sweep.points)
        self._message.header.stamp = time_from_s(sweep.stamp_s)
        self._sweeps.publish(self._message)
        self.set_health(True, f"sweeps arrive, layout {sweep.layout}, stamped at the {sweep.stamp_at.value} point")
        order = self._adapter.ring_order
        self.report.values |= {
            "layout": sweep.layout,
            "stamp at": sweep.stamp_at.value,
            "points": str(len(sweep.points)),
            "points without a return": str(sweep.empty),
            "rings": order.value if order is not None else "not known yet",
            **self._adapter.counters.values(),
        }

    def _watch(self) -> None:
        """Reports silence; old clouds are never repeated."""
        self.report.values |= self._adapter.counters.values()
        if self._clouds.received and self._clouds.age_s() > self.params.silence_s:
            self.set_health(False, f"{self.params.topic} is silent")


def _cloud_of(message: PointCloud2 | CloudView) -> Cloud:
    data = message.data if isinstance(message.data, np.ndarray) else np.frombuffer(message.data, np.uint8)
    fields = tuple(Field(item.name, item.offset, item.datatype, item.count) for item in message.fields)
    return Cloud(
        message.header.frame_id,
        time_to_s(message.header.stamp),
        message.height,
        message.width,
        fields,
        bool(message.is_bigendian),
        message.point_step,
        message.row_step,
        data,
    )
