"""The simulated engine as a library of the port."""

from __future__ import annotations

from robot_stack.wmx import Library
from robot_stack.wmx import api as port
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.simulated.client import ClientLimits, CoreMotion, Io, WMX3Api
from robot_stack.wmx.simulated.client_network import Ecat
from robot_stack.wmx.simulated.client_splines import AdvancedMotion


def simulated_library(call_timeout_s: float, status_stale_s: float) -> Library:
    """Clients of a simulated engine, each with the given patience."""
    limits = ClientLimits(call_timeout_s, status_stale_s)
    return Library(
        WMX3Api=lambda: WMX3Api(limits),
        CoreMotion=lambda api: CoreMotion(_own(api)),
        Io=lambda api: Io(_own(api)),
        Ecat=lambda api: Ecat(_own(api)),
        AdvancedMotion=lambda api: AdvancedMotion(_own(api)),
        read_status=_read_status,
    )


def _own(api: port.WMX3Api) -> WMX3Api:
    if not isinstance(api, WMX3Api):
        raise TypeError(f"the device must be one of the simulated engine, is a {type(api).__name__}")
    return api


def _read_status(api: port.WMX3Api, *_: object) -> tuple[int, StatusSnapshot]:
    return _own(api).snapshot()
