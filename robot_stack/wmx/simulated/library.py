"""The simulated engine as a library of the port."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from robot_stack.wmx.api import port
from robot_stack.wmx.engine import Library
from robot_stack.wmx.simulated.client import AdvancedMotion, CoreMotion, Device, Ecat, Io


def simulated_library(call_timeout_s: float, status_stale_s: float) -> Library:
    """Clients of a simulated engine, each with the given timeouts."""
    return library_of(lambda: Device(call_timeout_s, status_stale_s))


def library_of(make_device: Callable[[], Device]) -> Library:
    """The port's objects of a device."""
    return Library(
        WMX3Api=lambda: cast(port.WMX3Api, make_device()),
        CoreMotion=lambda api: cast(port.CoreMotion, CoreMotion(_own(api))),
        Io=lambda api: cast(port.Io, Io(_own(api))),
        Ecat=lambda api: cast(port.Ecat, Ecat(_own(api))),
        AdvancedMotion=lambda api: cast(port.AdvancedMotion, AdvancedMotion(_own(api))),
        read_status=lambda api, *_: _own(api).snapshot(),
        feedback_reader=lambda api: _own(api).feedback,
    )


def _own(api: port.WMX3Api) -> Device:
    if not isinstance(api, Device):
        raise TypeError(f"the device must be one of the simulated engine, is a {type(api).__name__}")
    return api
