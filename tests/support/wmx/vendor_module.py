"""The fake of the vendor's module as an importable file in a folder, like the vendor's."""

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
    """Writes the module of a variant into ``folder``; ``more`` is additional code that breaks it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{MODULE_NAME}.py").write_text(_SOURCE.format(variant=variant) + more, encoding="utf-8")


@contextmanager
def no_module() -> Iterator[None]:
    """Within the context the module is not imported; afterwards its previous state is restored."""
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
    """Imports the module of a variant from ``folder``; the context removes it at its end."""
    with no_module():
        write_module(folder, variant, more)
        sys.path.insert(0, str(folder))
        try:
            yield importlib.import_module(MODULE_NAME)
        finally:
            sys.path.remove(str(folder))
