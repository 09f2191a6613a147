"""The fake of the vendor's module as a file that can be imported from a folder, as the vendor's is."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

MODULE_NAME = "WMX3ApiPython"
_SOURCE = """
from tests.support.wmx.vendor_fake import VARIANTS, Control
from tests.support.wmx.vendor_surface import fill

fill(globals(), VARIANTS[{variant!r}], Control())
"""


def write_module(folder: Path, variant: str, more: str = "") -> None:
    """Writes the module of a variant into ``folder``; ``more`` is code that breaks it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{MODULE_NAME}.py").write_text(_SOURCE.format(variant=variant) + more, encoding="utf-8")


@contextmanager
def no_module() -> Iterator[None]:
    """Within it the module is not imported yet; afterwards it is again what it was before."""
    before = sys.modules.pop(MODULE_NAME, None)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.modules.pop(MODULE_NAME, None)
        if before is not None:
            sys.modules[MODULE_NAME] = before


@contextmanager
def fake_module(folder: Path, variant: str, more: str = "") -> Iterator[ModuleType]:
    """The module of a variant, imported from ``folder``; gone afterwards."""
    with no_module():
        write_module(folder, variant, more)
        sys.path.insert(0, str(folder))
        try:
            yield importlib.import_module(MODULE_NAME)
        finally:
            sys.path.remove(str(folder))
