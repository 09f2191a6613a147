"""Messages filled in as bytes, decoded by the middleware."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image, Imu, JointState, PointCloud2

from robot_stack.core.point_cloud import SWEEP
from robot_stack.middleware.point_cloud import cloud_message, points_of
from sim.nodes.bodies import matrices_of
from sim.nodes.message_bytes import CloudBytes, ImageBytes, Numbers, Transforms, read_transforms, restamped
from tf2_msgs.msg import TFMessage

STAMP = Time(sec=5, nanosec=7)


def test_numbers_lie_where_they_are_put() -> None:
    odometry = Numbers(Odometry(child_frame_id="base_link"))
    odometry.put(85, range(1, 8))
    odometry.put(42, range(11, 17))
    read = deserialize_message(odometry.stamped(STAMP), Odometry)
    pose, twist = read.pose.pose, read.twist.twist
    assert (read.header.stamp, read.child_frame_id) == (STAMP, "base_link")
    assert (pose.position.x, pose.orientation.x, pose.orientation.w) == (1.0, 4.0, 7.0)
    assert (twist.linear.x, twist.angular.x, twist.angular.z) == (11.0, 14.0, 16.0)
    assert not read.pose.covariance.any()
    assert not read.twist.covariance.any()
    joints = Numbers(JointState(name=["a", "bcd"], position=[0.0] * 2, velocity=[0.0] * 2, effort=[0.0] * 2))
    joints.put(2, [5.0, 6.0])
    joints.put(2 + 3, [3.0, 4.0])
    joints.put(2 + 3 + 3, [1.0, 2.0])
    read = deserialize_message(joints.stamped(STAMP), JointState)
    assert (list(read.position), list(read.velocity), list(read.effort)) == ([1.0, 2.0], [3.0, 4.0], [5.0, 6.0])
    unit = Numbers(Imu())
    unit.put(37, range(1, 5))
    unit.put(24, range(5, 8))
    unit.put(12, range(8, 11))
    read = deserialize_message(unit.stamped(STAMP), Imu)
    assert (read.orientation.w, read.angular_velocity.x, read.linear_acceleration.z) == (4.0, 5.0, 10.0)


def test_transforms_are_written_and_read() -> None:
    transforms = Transforms()
    for names in (("base_link", "wheelchair"), ("base_link", "person_anna", "x"), ()):
        bodies = [(name, np.arange(7.0) + index) for index, name in enumerate(names)]
        data = transforms.filled(bodies, STAMP)
        read = deserialize_message(data, TFMessage).transforms
        assert [item.child_frame_id for item in read] == list(names)
        for index, item in enumerate(read):
            t, q = item.transform.translation, item.transform.rotation
            assert (item.header.stamp, item.header.frame_id) == (STAMP, "map")
            assert [t.x, t.y, t.z, q.w, q.x, q.y, q.z] == [index + number for number in range(7)]
        time_s, poses = read_transforms(data)
        assert list(poses) == list(names)
        assert time_s == (5.000000007 if names else 0.0)
        assert all(poses[item.child_frame_id][3] == item.transform.rotation.x for item in read)


def test_poses_become_matrices() -> None:
    half = np.sqrt(0.5)
    poses = np.array([[1.0, 2.0, 3.0, 0.0, 0.0, half, half], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    turned, broken = matrices_of(poses)
    np.testing.assert_allclose(turned, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-12)
    assert not np.isfinite(broken).all()


def test_clouds_and_images() -> None:
    points = np.zeros(5, SWEEP)
    points["ring"] = np.arange(5)
    data = CloudBytes(cloud_message(np.empty(0, SWEEP), "lidar")).filled(points, STAMP)
    cloud = deserialize_message(restamped(data, Time(sec=9)), PointCloud2)
    assert (cloud.header.stamp.sec, cloud.header.frame_id, cloud.is_dense) == (9, "lidar", True)
    assert (cloud.width, cloud.height, cloud.row_step) == (5, 1, 120)
    assert points_of(cloud, SWEEP)["ring"].tolist() == [0, 1, 2, 3, 4]
    picture = np.arange(6, dtype=np.uint8).reshape(2, 3)
    image = deserialize_message(
        ImageBytes(Image(height=2, width=3, encoding="mono8", step=3)).filled(picture, STAMP), Image
    )
    assert (image.header.stamp, image.encoding, list(image.data)) == (STAMP, "mono8", [0, 1, 2, 3, 4, 5])
