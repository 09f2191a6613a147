"""An engine behind the vendor adapter: the adapter on the fake module, the fake on a simulated engine in a thread."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from tests.support.wmx.vendor_module import fake_module
from tests.unit.wmx.harness import N_AXES, ThreadHarness, runtime_folder

N_IO_BYTES = 4


class VendorHarness(ThreadHarness):
    """``config`` names the vendor's engine; ``module`` is the fake that the adapter finds there."""

    def __init__(self, folder: Path, module: ModuleType, **changes: Any) -> None:
        super().__init__(folder, **changes)
        self.module = module
        self.config = self.config.model_copy(
            update={
                "engine": "vendor",
                "library_path": str(Path(str(module.__file__)).parent),
                "vendor_axes": N_AXES,
                "vendor_io_bytes": N_IO_BYTES,
            }
        )


@contextmanager
def vendor_harness(variant: str, more: str = "", **changes: Any) -> Iterator[VendorHarness]:
    """A running engine behind the adapter, until the block ends."""
    with runtime_folder() as folder, fake_module(folder / "module", variant, more) as module:
        harness = VendorHarness(folder, module, **changes)
        try:
            yield harness
        finally:
            harness.stop()
