"""Finds and checks the vendor's Python module. It is imported only on request.

Loading checks its classes, the calls and the status fields that motion requires, and
which of two names a class has in this version.
"""

from __future__ import annotations

import importlib
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from robot_stack.wmx.api import surface
from robot_stack.wmx.vendor.member import missing
from robot_stack.wmx.vendor.snapshots import NEEDED

MODULE_NAME: Final = "WMX3ApiPython"
REQUIRED: Final = (
    "WMX3Api",
    "CoreMotion",
    "ErrorCode",
    "CoreMotionErrorCode",
    "AxisSelection",
    "Profile",
    "Motion_PosCommand",
    "Velocity_VelCommand",
)
IO_NAMES: Final = ("Io", "IO")
_OF_STATUS, _OF_IMAGES = ("GetStatus",), ("GetInBytes", "GetOutBytes")
"""Needed to read the status, beside the calls of the surface."""
_SETTING: Final = "library_path in config/wmx_client.yaml"


class VendorLibraryError(Exception):
    """The vendor's library is missing, does not load here, or lacks a part that the port needs."""


@dataclass(frozen=True, slots=True)
class Surface:
    """The module and the constructors that differ between its versions. A module that is not there is None."""

    module: ModuleType
    io: Any
    ecat: Any
    advanced_motion: Any


def import_vendor(library_path: str) -> ModuleType:
    """The vendor's module from the folder ``library_path`` ("": Python's own path). Raises VendorLibraryError."""
    folder = Path(library_path) if library_path else None
    if folder is not None and not folder.is_dir():
        raise VendorLibraryError(f"{_SETTING}: {folder} is no folder; it must hold the vendor's {MODULE_NAME}.py")
    loaded = sys.modules.get(MODULE_NAME)
    if loaded is not None and folder is not None and not _is_in(loaded, folder):
        raise VendorLibraryError(
            f"{_SETTING}: {MODULE_NAME} is loaded from {loaded.__file__} already, not from {folder}"
        )
    if folder is not None:
        sys.path.insert(0, str(folder))
    try:
        return importlib.import_module(MODULE_NAME)
    except ModuleNotFoundError as error:
        where = f"in {folder}" if folder else "on Python's search path (library_path is empty)"
        raise VendorLibraryError(
            f"the vendor's library {error.name} was not found {where}; install it with the motion engine and set "
            f"{_SETTING}, or choose engine: simulated"
        ) from error
    except Exception as error:  # loading a native module may raise any exception
        raise VendorLibraryError(f"the vendor's library {MODULE_NAME} does not load: {error}") from error
    finally:
        if folder is not None:
            sys.path.remove(str(folder))


def _is_in(module: ModuleType, folder: Path) -> bool:
    return module.__file__ is not None and Path(module.__file__).resolve().parent == folder.resolve()


def probe(module: ModuleType) -> Surface:
    """The parts of this version of the module. Raises VendorLibraryError naming the missing ones."""
    lacking = [name for name in REQUIRED if not hasattr(module, name)]
    io = next((getattr(module, name) for name in IO_NAMES if hasattr(module, name)), None)
    if io is None:
        lacking.append(" or ".join(IO_NAMES))
    axis_status = getattr(module, "CoreMotionAxisStatus", None)
    if axis_status is not None:
        lacking += [f"CoreMotionAxisStatus.{name}" for name in NEEDED if not hasattr(axis_status, name)]
    if not lacking:
        lacking = _missing_calls(module, io)
    if lacking:
        raise VendorLibraryError(
            f"the vendor's library {module.__file__} lacks {', '.join(lacking)}; point {_SETTING} at a version "
            "that has them, or choose engine: simulated"
        )
    return Surface(module, io, getattr(module, "Ecat", None), getattr(module, "AdvancedMotion", None))


def _missing_calls(module: ModuleType, io: Any) -> list[str]:
    """Checked on objects without a device: the vendor's own examples create them before a device."""
    api = module.WMX3Api()
    core = module.CoreMotion(api)
    lacking = [f"WMX3Api.{name}" for name in missing(api, surface.API)]
    lacking += [f"CoreMotion.{name}" for name in (*missing(core, surface.CORE_MOTION), *_absent(core, _OF_STATUS))]
    for member in ("axisControl", "motion", "velocity", "home", "config"):
        theirs = getattr(core, member, None)
        if theirs is None:
            lacking.append(f"CoreMotion.{member}")
        else:
            lacking += [f"CoreMotion.{member}.{name}" for name in missing(theirs, surface.SURFACE[member])]
    return lacking + [f"{io.__name__}.{name}" for name in (*missing(io, surface.IO), *_absent(io, _OF_IMAGES))]


def _absent(theirs: Any, names: tuple[str, ...]) -> list[str]:
    return [name for name in names if not callable(getattr(theirs, name, None))]
