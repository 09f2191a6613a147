"""The vendor's engine behind the port. The vendor's library is looked for only when it is asked for."""

from __future__ import annotations

import time
from typing import cast

from robot_stack.wmx import EngineError, Library
from robot_stack.wmx.api import AdvancedMotion, CoreMotion, Ecat, ErrorCode, Io, WMX3Api
from robot_stack.wmx.axes import StatusSnapshot, empty_snapshot
from robot_stack.wmx.vendor.adapter import Delegate, EcatDelegate, Translator, snapshot
from robot_stack.wmx.vendor.probe import VendorLibraryError, import_vendor


def vendor_library(library_path: str, n_axes: int, n_io_bytes: int) -> Library:
    """The vendor's library from the folder ``library_path``. Raises EngineError if it is missing or unfit.

    Snapshots hold the first ``n_axes`` axes and the first ``n_io_bytes`` bytes of inputs and outputs.
    """
    try:
        module = import_vendor(library_path)
    except VendorLibraryError as error:
        raise EngineError("vendor engine", ErrorCode.IMLibIsNotRunning, str(error)) from error
    translate = Translator(module)

    def theirs(api: WMX3Api) -> object:
        return cast(Delegate, api).theirs

    def read_status(_: WMX3Api, core_motion: CoreMotion, io: Io) -> tuple[int, StatusSnapshot]:
        code, status = core_motion.GetStatus()
        if code:
            return code, empty_snapshot()
        axes = [status.GetAxesStatus(axis) for axis in range(n_axes)]
        # A failed read leaves the image empty, and a bit beyond the image reads 0.
        inputs, outputs = (read(0, n_io_bytes)[1] for read in (io.GetInBytes, io.GetOutBytes))
        return code, snapshot(status, axes, inputs, outputs, time.monotonic_ns())

    return Library(
        WMX3Api=lambda: cast(WMX3Api, Delegate(module.WMX3Api(), translate)),
        CoreMotion=lambda api: cast(CoreMotion, Delegate(module.CoreMotion(theirs(api)), translate)),
        Io=lambda api: cast(Io, Delegate(module.Io(theirs(api)), translate)),
        Ecat=lambda api: cast(Ecat, EcatDelegate(module.Ecat(theirs(api)), translate)),
        AdvancedMotion=lambda api: cast(AdvancedMotion, Delegate(module.AdvancedMotion(theirs(api)), translate)),
        read_status=read_status,
    )
