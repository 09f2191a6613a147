"""Clouds and images read from bytes, compared with the middleware's own serialisation."""

from __future__ import annotations

from array import array
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from robot_stack.middleware.wire import READERS, CloudView, ImageView
from robot_stack.ros import transport  # noqa: F401 - needed to find the wheels' libraries

read_cloud, read_image = READERS["sensor_msgs/msg/PointCloud2"], READERS["sensor_msgs/msg/Image"]

texts = st.text(st.characters(blacklist_characters="\0", blacklist_categories=("Cs",)), max_size=9)
headers = st.builds(
    lambda s, ns, name: Header(stamp=Time(sec=s, nanosec=ns), frame_id=name),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(0, 2**32 - 1),
    texts,
)
u32 = st.integers(0, 2**32 - 1)
octets = st.binary(max_size=70).map(lambda data: array("B", data))
fields = st.builds(
    lambda name, offset, kind, count: PointField(name=name, offset=offset, datatype=kind, count=count),
    texts,
    u32,
    st.integers(0, 255),
    u32,
)


def assert_same(view: Any, message: Any, names: tuple[str, ...]) -> None:
    assert view.header == message.header
    for name in names:
        assert getattr(view, name) == getattr(message, name), name
    assert bytes(view.data) == bytes(message.data)


@given(headers, u32, u32, st.lists(fields, max_size=7), st.booleans(), u32, u32, octets, st.booleans())
def test_a_cloud_is_what_the_middleware_says(
    header: Any, height: int, width: int, items: list[Any], big: bool, step: int, row: int, data: Any, dense: bool
) -> None:
    message = PointCloud2(
        header=header,
        height=height,
        width=width,
        fields=items,
        is_bigendian=big,
        point_step=step,
        row_step=row,
        data=data,
        is_dense=dense,
    )
    view = read_cloud(serialize_message(message))
    assert isinstance(view, CloudView)
    assert_same(view, message, ("height", "width", "is_bigendian", "point_step", "row_step", "is_dense"))
    found = [(item.name, item.offset, item.datatype, item.count) for item in view.fields]
    assert found == [(item.name, item.offset, item.datatype, item.count) for item in message.fields]


@given(headers, u32, u32, texts, st.integers(0, 255), u32, octets)
def test_an_image_is_what_the_middleware_says(
    header: Any, height: int, width: int, encoding: str, big: int, step: int, data: Any
) -> None:
    message = Image(
        header=header, height=height, width=width, encoding=encoding, is_bigendian=big, step=step, data=data
    )
    view = read_image(serialize_message(message))
    assert isinstance(view, ImageView)
    assert_same(view, message, ("height", "width", "encoding", "is_bigendian", "step"))


def test_data_keeps_the_bytes_alive_and_is_like_any_other_array() -> None:
    data = read_image(serialize_message(Image(data=array("B", range(100))))).data
    assert data.sum() == 4950
    assert (data.flags.writeable, data.flags.aligned, data.flags.c_contiguous) == (True, True, True)


def test_points_lie_where_floats_may_lie() -> None:
    cloud = PointCloud2(header=Header(frame_id="abc"), data=array("B", bytes(32)))
    assert read_cloud(serialize_message(cloud)).data.ctypes.data % 4 == 0


@pytest.mark.parametrize("cut", [0, 3, 9, 30, -1])
def test_reading_truncated_cloud_raises(cut: int) -> None:
    data = serialize_message(PointCloud2(header=Header(frame_id="lidar"), data=array("B", bytes(100))))
    with pytest.raises(Exception, match=r".+"):
        read_cloud(data[:cut])


def test_another_encoding_is_left_to_the_middleware() -> None:
    message = PointCloud2(height=1, width=2, data=array("B", b"ab"))
    data = serialize_message(message)
    big = bytes([0, 0]) + data[2:]
    try:
        view = read_cloud(big)
    except Exception:
        return
    assert not isinstance(view, CloudView)
