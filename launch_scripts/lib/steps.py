"""What the steps of the set-up share: stamps of finished steps, running commands, one kind of error."""

import hashlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path


class Fault(Exception):
    """A step cannot be done; the text says what failed and what to do."""


def digest(*parts: str | Path | Iterable[Path]) -> str:
    """Hash over texts and the names and contents of files."""
    summary = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            summary.update(part.encode() + b"\0")
            continue
        for path in [part] if isinstance(part, Path) else part:
            content = path.read_bytes()
            summary.update(f"{path.name}\0{len(content)}\0".encode() + content)
    return summary.hexdigest()


class Steps:
    """Runs the steps whose inputs changed since they last succeeded."""

    def __init__(self, stamps: Path) -> None:
        self._stamps = stamps
        self.done = 0

    def run(self, name: str, title: str, key: str, action: Callable[[], None]) -> None:
        if self.is_done(name, key):
            return
        print(f"  {title}", flush=True)
        started = time.monotonic()
        action()
        self.finish(name, key)
        print(f"    done in {time.monotonic() - started:.1f} s", flush=True)

    def finish(self, name: str, key: str) -> None:
        self._stamps.mkdir(parents=True, exist_ok=True)
        replace_file(self._stamps / name, key)
        self.done += 1

    def is_done(self, name: str, key: str) -> bool:
        stamp = self._stamps / name
        return stamp.exists() and stamp.read_text() == key


def run(command: Sequence[str], environment: dict[str, str] | None = None) -> None:
    """Runs a command whose output is worth seeing as it comes."""
    result = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=sys.stderr, check=False)
    if result.returncode:
        raise Fault(f"exit code {result.returncode} of: {' '.join(command)}")


def run_logged(command: Sequence[str], environment: dict[str, str], log: Path) -> None:
    """Runs a command with its output appended to a file, whose end is shown if it fails."""
    with log.open("ab") as output:
        result = subprocess.run(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=output, check=False
        )
    if result.returncode:
        end = "\n".join(log.read_text(errors="replace").splitlines()[-40:])
        raise Fault(f"{end}\nexit code {result.returncode} of: {' '.join(command)}\nwhole log: {log}")


def replace_file(path: Path, content: str | bytes, mode: int = 0o644) -> None:
    """Writes a file so that a reader sees the old or the new one, never half of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.write_bytes(content.encode() if isinstance(content, str) else content)
    draft.chmod(mode)
    draft.replace(path)
