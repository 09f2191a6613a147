"""One folder of logs for each run: ``<log dir>/<time>-domain-N``, and ``latest`` that points to the newest."""

from __future__ import annotations

import errno
import os
import re
import shutil
from datetime import datetime
from pathlib import Path

from robot_stack.core.runtime import state_home

_FULL = (errno.ENOSPC, errno.EDQUOT)
_RUN = re.compile(r"\d{8}-\d{6}(-\d+)?-domain-\d+")


def default_log_dir() -> Path:
    return state_home() / "logs"


def new_run(log_dir: Path, domain: int, now: datetime, keep_runs: int) -> Path:
    """Makes the folder of a new run, moves ``latest`` to it and deletes the oldest runs beyond ``keep_runs``.

    On a full disk there is none: the result is /dev/null, and the logs of the run are lost. Raises OSError if the
    folder cannot be made for another reason.
    """
    try:
        log_dir.mkdir(parents=True, exist_ok=True)
        run = _make(log_dir, f"{now:%Y%m%d-%H%M%S}", domain)
        _point(log_dir / "latest", run)
    except OSError as error:
        if error.errno not in _FULL:
            raise
        return Path(os.devnull)
    for old in _runs(log_dir)[:-keep_runs]:
        shutil.rmtree(old, ignore_errors=True)
    return run


def _make(log_dir: Path, moment: str, domain: int) -> Path:
    for attempt in range(1, 100):
        suffix = "" if attempt == 1 else f"-{attempt}"
        run = log_dir / f"{moment}{suffix}-domain-{domain}"
        try:
            run.mkdir()
        except FileExistsError:
            continue
        return run
    raise FileExistsError(f"{log_dir}: 99 runs began in the second {moment}")


def _point(link: Path, run: Path) -> None:
    # Renaming over the old link leaves no moment without one.
    fresh = link.with_name(f".{link.name}-{os.getpid()}")
    fresh.symlink_to(run.name)
    fresh.replace(link)


def _runs(log_dir: Path) -> list[Path]:
    return sorted(item for item in log_dir.iterdir() if item.is_dir() and _RUN.fullmatch(item.name))


def tail(path: Path, lines: int = 15) -> str:
    """The last lines of a log; empty if there is none."""
    try:
        return "\n".join(path.read_text(encoding="utf-8", errors="replace").splitlines()[-lines:])
    except OSError:
        return ""
