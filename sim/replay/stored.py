"""The configuration that is stored with a recording, in force for a while."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from robot_stack.core.config import config_dir
from sim.replay.recorded import ReplayError


@contextlib.contextmanager
def stored_configuration(configuration: bytes) -> Iterator[None]:
    """The stored YAML files in force. The other files, which are identified by checksums in them, are the present ones.

    configuration: the archive ``CONFIG_FILE``. Raises ReplayError for an archive that cannot be read.
    """
    before = os.environ.get("ROBOT_STACK_CONFIG")
    with tempfile.TemporaryDirectory(prefix="robot_stack_replay-") as name:
        folder = Path(name) / "config"
        shutil.copytree(config_dir(), folder, ignore=shutil.ignore_patterns("*.yaml"))
        try:
            with tarfile.open(fileobj=io.BytesIO(configuration), mode="r:gz") as archive:
                for member in archive:
                    if content := archive.extractfile(member):
                        _write(Path(name), member.name, content.read())
        except (tarfile.TarError, OSError, EOFError) as error:
            raise ReplayError(f"the configuration stored with the recording cannot be read: {error}") from None
        os.environ["ROBOT_STACK_CONFIG"] = str(folder)
        try:
            yield
        finally:
            if before is None:
                os.environ.pop("ROBOT_STACK_CONFIG", None)
            else:
                os.environ["ROBOT_STACK_CONFIG"] = before


def _write(folder: Path, name: str, content: bytes) -> None:
    """Writes a file of the archive; the filter of ``extractall`` is missing before Python 3.11.4."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise tarfile.TarError(f"{name} is outside of the folder")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
