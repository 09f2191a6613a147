"""The vendor's engine behind the port. The vendor's library is loaded only on request.

Written against the published surface of engine version 3.5 and newer, and not yet run on a machine with
one; docs/wmx_vendor.md lists what is verified.
"""

from __future__ import annotations

from typing import Any, cast

from robot_stack.wmx import api as port
from robot_stack.wmx.api import ErrorCode
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.engine import EngineError, Library
from robot_stack.wmx.vendor import adapter
from robot_stack.wmx.vendor.probe import Surface, VendorLibraryError, import_vendor, probe
from robot_stack.wmx.vendor.records import Records
from robot_stack.wmx.vendor.splines import AdvancedMotion


def vendor_library(library_path: str, n_axes: int, n_io_bytes: int, status_stale_s: float) -> Library:
    """The vendor's library from the folder ``library_path``. Raises EngineError if it is missing or unfit.

    Snapshots hold the first ``n_axes`` axes and the first ``n_io_bytes`` bytes of inputs and outputs. A status whose
    cycle counter stood still for ``status_stale_s`` of communication is refused.
    """
    try:
        surface = probe(import_vendor(library_path))
    except VendorLibraryError as error:
        # Not "no engine is running there", which is retried silently: this needs an operator.
        raise EngineError("vendor engine", ErrorCode.StartProcessFailed, str(error)) from error
    return library(surface, Records(surface.module, n_axes), n_io_bytes, status_stale_s)


def library(surface: Surface, records: Records, n_io_bytes: int, status_stale_s: float) -> Library:
    """The constructors of the adapter's objects for a module that was probed."""

    def core_motion(api: port.WMX3Api) -> port.CoreMotion:
        theirs = surface.module.CoreMotion(_own(api).theirs)
        return cast(port.CoreMotion, adapter.CoreMotion(theirs, records, status_stale_s))

    def read_status(_: port.WMX3Api, core: port.CoreMotion, io: port.Io) -> tuple[int, StatusSnapshot]:
        return cast(adapter.CoreMotion, core).snapshot(cast(adapter.InputsOutputs, io))

    def io(api: port.WMX3Api) -> port.Io:
        return cast(port.Io, adapter.InputsOutputs(surface.io(_own(api).theirs), records, n_io_bytes))

    return Library(
        WMX3Api=lambda: cast(port.WMX3Api, adapter.Device(surface.module.WMX3Api(), records)),
        CoreMotion=core_motion,
        Io=io,
        Ecat=lambda api: cast(port.Ecat, adapter.Network(_made(surface.ecat, api), records)),
        AdvancedMotion=lambda api: cast(
            port.AdvancedMotion, AdvancedMotion(_made(surface.advanced_motion, api), records)
        ),
        read_status=read_status,
    )


class Absent:
    """Replaces a part that this version of the library lacks: each call returns NoSupportedFunction."""

    advMotion = None

    @staticmethod
    def ErrorToString(code: int) -> str:
        return f"this version of the vendor's library has no such part (error {code})"


def _made(constructor: Any, api: port.WMX3Api) -> Any:
    return Absent() if constructor is None else constructor(_own(api).theirs)


def _own(api: port.WMX3Api) -> adapter.Device:
    if not isinstance(api, adapter.Device):
        raise TypeError(f"the device must be one of the vendor's engine, is a {type(api).__name__}")
    return api
