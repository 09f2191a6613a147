"""The point cloud adapters with another vendor's driver, over DDS."""

from __future__ import annotations

from array import array
from dataclasses import replace

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.point_cloud import SWEEP
from robot_stack.drivers.point_cloud.cloud import Cloud
from robot_stack.middleware.conversions import time_from_s, time_to_s
from robot_stack.middleware.point_cloud import points_of
from tests.support.peer import Peer, says
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for
from tests.unit.drivers.vendor_clouds import LIVOX, OUSTER, SPAN_S, cloud_of, scene

SEEN = scene(64, 64)
ADAPTERS = {
    "point_cloud_adapter": (topics.VENDOR_POINTS, topics.LIDAR_POINTS, "lidar", OUSTER),
    "overhead_lidar_adapter": (
        topics.OVERHEAD_VENDOR_POINTS, topics.OVERHEAD_LIDAR_POINTS, "overhead_lidar", LIVOX,
    ),
}  # fmt: skip


def message_of(cloud: Cloud) -> PointCloud2:
    fields = [PointField(name=f.name, offset=f.offset, datatype=f.datatype, count=f.count) for f in cloud.fields]
    message = PointCloud2(
        height=cloud.height, width=cloud.width, fields=fields, is_bigendian=cloud.is_bigendian,
        point_step=cloud.point_step, row_step=cloud.row_step, is_dense=True,
    )  # fmt: skip
    message.header.frame_id, message.header.stamp = cloud.frame_id, time_from_s(cloud.stamp_s)
    message.data = array("B", cloud.data.tobytes())
    return message


class VendorDriver:
    """Another vendor's driver: sweeps that end now, in the vendor's layout."""

    def __init__(self, peer: Peer, name: str, seen: object) -> None:
        self.peer, self.row = peer, ADAPTERS[name][0]
        self.vendor, self.seen = ADAPTERS[name][3], seen
        self.changes: dict[str, object] = {}

    def sweep(self) -> PointCloud2:
        start_s = self.peer.node.get_clock().now().nanoseconds / 1e9 - SPAN_S - 0.005
        return message_of(replace(cloud_of(self.vendor, self.seen, start_s=start_s, padding=5), **self.changes))

    def run(self) -> None:
        self.peer.repeat(self.row, self.sweep, 10.0)

    def stop(self) -> None:
        self.peer.silence(self.row)


def launch(start: Start, name: str, row: Topic) -> NodeProcess:
    return start(name, "-p", f"topic:={row.name}", "-p", "frame_id:=vendor_frame")


@pytest.mark.parametrize("name", ADAPTERS)
def test_vendor_cloud_is_converted_and_silence_is_reported(start: Start, peer: Peer, name: str) -> None:
    vendor_row, row, frame, vendor = ADAPTERS[name]
    sweeps, diagnostics = peer.listen(row), peer.listen(topics.DIAGNOSTICS)
    mountings = peer.listen(topics.TF_STATIC)
    # The overhead LiDAR has forty rings in robot.yaml, this one has sixty-four.
    seen = SEEN if frame == "lidar" else scene(16, 64)
    driver = VendorDriver(peer, name, seen)
    launch(start, name, vendor_row)
    peer.wait_matched(vendor_row)
    driver.run()
    wait_for(lambda: len(sweeps.items) >= 5, "sweeps")
    points = points_of(sweeps.last, SWEEP)
    assert (sweeps.last.header.frame_id, len(points)) == (frame, len(seen.xyz))
    assert points["time"].max() == 0.0
    assert points["time"].min() == pytest.approx(-SPAN_S, abs=1e-4)
    assert set(np.unique(points["ring"])) == set(range(seen.rings))
    stamps = np.array([time_to_s(message.header.stamp) for message in sweeps.messages])
    assert (np.diff(stamps) > 0.0).all()
    values = says(diagnostics, name, "sweeps arrive")
    assert (values["layout"], values["stamp at"]) == (vendor.name, "first")
    (place,) = mountings.wait(lambda message: message.transforms, "the mounting").transforms
    assert (place.header.frame_id, place.child_frame_id) == ("base_link", frame)
    # The cable is pulled: the node reports it and repeats no old data; after plugging in it continues.
    driver.stop()
    says(diagnostics, name, f"{vendor_row.name} is silent")
    count = len(sweeps.items)
    says(diagnostics, name, f"{vendor_row.name} is silent")
    assert len(sweeps.items) == count
    driver.changes = {"is_bigendian": True}
    driver.run()
    values = says(diagnostics, name, "the cloud is big endian, expected little endian")
    assert int(values["sweeps refused"]) > 0
    assert len(sweeps.items) == count
    driver.changes = {}
    wait_for(lambda: len(sweeps.items) >= count + 3, "sweeps again")
