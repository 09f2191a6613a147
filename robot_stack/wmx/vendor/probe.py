"""Finds and checks the vendor's Python module. Nothing of it is imported before somebody asks for it."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType
from typing import Final

MODULE_NAME: Final = "WMX3ApiPython"
REQUIRED: Final = (
    "WMX3Api",
    "CoreMotion",
    "Io",
    "Ecat",
    "AxisSelection",
    "Profile",
    "Motion_PosCommand",
    "Motion_JogCommand",
    "Motion_TimedJogCommand",
    "Velocity_VelCommand",
    "Velocity_TimedVelCommand",
)


class VendorLibraryError(Exception):
    """The vendor's library is missing, does not load here, or lacks what the port needs."""


def import_vendor(library_path: str) -> ModuleType:
    """The vendor's module from the folder ``library_path`` ("": Python's own path). Raises VendorLibraryError."""
    folder = Path(library_path) if library_path else None
    if folder is not None and not folder.is_dir():
        raise VendorLibraryError(f"library_path: {folder} is no folder; it must hold the vendor's {MODULE_NAME}.py")
    if folder is not None:
        sys.path.insert(0, str(folder))
    try:
        module = importlib.import_module(MODULE_NAME)
    except ModuleNotFoundError as error:
        where = f"in {folder}" if folder else "on Python's search path (library_path is empty)"
        raise VendorLibraryError(
            f"the vendor's library {error.name} was not found {where}; install it with the motion engine and set "
            "library_path in config/wmx_client.yaml, or choose engine: simulated"
        ) from error
    except Exception as error:  # a native module may fail to load in any way it likes
        raise VendorLibraryError(f"the vendor's library {MODULE_NAME} does not load: {error}") from error
    finally:
        if folder is not None:
            sys.path.remove(str(folder))
    missing = [name for name in REQUIRED if not hasattr(module, name)]
    if missing:
        raise VendorLibraryError(f"the vendor's library {module.__file__} lacks {', '.join(missing)}")
    return module
