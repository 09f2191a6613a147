"""Messages to bytes and back; the same message always gives the same bytes.

rclpy serialises into uninitialised memory, so that the CDR padding between fields holds arbitrary bytes. Here the
buffer is zeroed. Needs no ``rclpy.init``.

Source: rmw/serialized_message.h, rcutils/types/uint8_array.h, and the capsules that rosidl_generator_py puts on the
metaclass of a message.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any, Final

from rclpy import get_rmw_implementation_identifier
from rclpy.serialization import deserialize_message
from rclpy.type_support import check_for_type_support

_FIRST_CAPACITY: Final = 1 << 20

_pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
_pointer_of.restype = ctypes.c_void_p
_pointer_of.argtypes = [ctypes.py_object, ctypes.c_char_p]
_CREATE = ctypes.PYFUNCTYPE(ctypes.c_void_p)
_DESTROY = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)
_CONVERT = ctypes.PYFUNCTYPE(ctypes.c_bool, ctypes.py_object, ctypes.c_void_p)


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = tuple((name, ctypes.c_void_p) for name in ("allocate", "deallocate", "reallocate", "zero", "state"))


class _Buffer(ctypes.Structure):
    """rcutils_uint8_array_t."""

    _fields_ = (
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    )


class _Serializer:
    """Reuses one buffer; used by one thread at a time, which the interpreter lock ensures."""

    def __init__(self) -> None:
        self._rmw_serialize = ctypes.PyDLL(f"lib{get_rmw_implementation_identifier()}.so").rmw_serialize
        self._rmw_serialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.POINTER(_Buffer)]
        utils = ctypes.CDLL("librcutils.so")
        utils.rcutils_get_default_allocator.restype = _Allocator
        self._buffer = _Buffer(allocator=utils.rcutils_get_default_allocator())
        self._libc = ctypes.CDLL(None)
        self._libc.calloc.restype = ctypes.c_void_p
        self._libc.calloc.argtypes = [ctypes.c_size_t, ctypes.c_size_t]
        self._libc.free.argtypes = [ctypes.c_void_p]
        self._make_room(_FIRST_CAPACITY)

    def bytes_of(self, message: Any) -> bytes:
        create, convert, destroy, support = _functions(type(message))  # type: ignore[arg-type]
        made = create()
        try:
            if not convert(message, made):
                raise TypeError(f"not a valid {type(message).__name__}: {message!r}")
            return self._serialize(made, support)
        finally:
            destroy(made)

    def _serialize(self, made: int, support: int) -> bytes:
        buffer = self._buffer
        place = buffer.buffer
        code = self._rmw_serialize(made, support, ctypes.byref(buffer))
        if code:
            raise RuntimeError(f"rmw_serialize answers {code}")
        if buffer.length > self._capacity:  # it grew into memory that is not zeroed
            self._make_room(2 * buffer.length)
            return self._serialize(made, support)
        data = ctypes.string_at(place, buffer.length)
        ctypes.memset(place, 0, buffer.length)
        buffer.length, buffer.capacity = 0, self._capacity  # rmw sets both to the size of the message
        return data

    def _make_room(self, capacity: int) -> None:
        if self._buffer.buffer:
            self._libc.free(self._buffer.buffer)
        self._buffer.buffer = self._libc.calloc(capacity, 1)
        self._buffer.length, self._buffer.capacity = 0, capacity
        self._capacity = capacity


@cache
def _functions(message_class: type) -> tuple[Any, Any, Any, int]:
    """(create, convert from Python, destroy, type support)."""
    meta = type(message_class)
    if not hasattr(meta, "_TYPE_SUPPORT"):
        raise TypeError(f"{message_class.__name__} is no message type")
    check_for_type_support(message_class)
    return (
        _CREATE(_address(meta, "_CREATE_ROS_MESSAGE")),
        _CONVERT(_address(meta, "_CONVERT_FROM_PY")),
        _DESTROY(_address(meta, "_DESTROY_ROS_MESSAGE")),
        _address(meta, "_TYPE_SUPPORT"),
    )


def _address(meta: type, name: str) -> int:
    capsule = getattr(meta, name)
    get_name = ctypes.pythonapi.PyCapsule_GetName
    get_name.restype, get_name.argtypes = ctypes.c_char_p, [ctypes.py_object]
    return int(_pointer_of(capsule, get_name(capsule)))


@cache
def _serializer() -> _Serializer:
    return _Serializer()


def serialize_message(message: Any) -> bytes:
    """CDR with its encapsulation header; padding is zero. Raises TypeError for fields of the wrong type."""
    return _serializer().bytes_of(message)


__all__ = ["deserialize_message", "serialize_message"]
