"""Begins of simulated runs that several tests share.

A test process makes a marked begin once and keeps it; each test goes on from it in a fork, which leaves no trace::

    pytestmark = shared(staged)  # every test of this module begins with ``staged()``
"""

from __future__ import annotations

import functools
import os
import pickle
import shutil
import signal
import tempfile
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, ParamSpec, Protocol, TypeVar

import pytest

from sim.stack.stack import SimulatedStack
from tests.support.environment import restore_environment


class Run(Protocol):
    """What may be shared: ``Stage`` or ``ScheduledRun``. The run writes into the two folders of its stack."""

    @property
    def stack(self) -> SimulatedStack: ...


P = ParamSpec("P")
RunT = TypeVar("RunT", bound=Run)
Key = tuple[Any, ...]


class FailedInFork(Exception):
    """Stands for the failure in the fork, whose report is shown."""


@dataclass
class Files:
    """The contents of folders. Files keep their identity, because a run holds pages of them in its memory."""

    folders: list[Path]
    _modes: list[tuple[Path, int]] = field(default_factory=list)
    _contents: list[tuple[Path, Path, bytes]] = field(default_factory=list)
    _linked: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        for folder in self.folders:
            links = Path(tempfile.mkdtemp(prefix="robot_stack_shared-", dir=folder.parent))
            self._linked.append(links)
            for path in [folder, *sorted(folder.rglob("*"))] if folder.exists() else []:
                if path.is_dir():
                    self._modes.append((path, path.stat().st_mode))
                else:
                    link = links / str(len(self._contents))
                    link.hardlink_to(path)
                    self._contents.append((path, link, path.read_bytes()))

    def restore(self) -> None:
        for folder in self.folders:
            shutil.rmtree(folder, ignore_errors=True)
        for path, mode in self._modes:
            path.mkdir(parents=True, exist_ok=True)
            path.chmod(mode)
        for path, link, content in self._contents:
            link.write_bytes(content)
            path.hardlink_to(link)

    def forget(self) -> None:
        for links in self._linked:
            shutil.rmtree(links, ignore_errors=True)


@dataclass
class Begin(Generic[RunT]):
    """A context that was entered and waits to be gone on with. environment: what it has set."""

    context: AbstractContextManager[RunT]
    value: RunT
    environment: dict[str, str]
    files: Files


class _GoingOn(AbstractContextManager[RunT]):
    def __init__(self, begin: Begin[RunT]) -> None:
        self._begin, self._outer = begin, dict(os.environ)

    def __enter__(self) -> RunT:
        os.environ.update(self._begin.environment)
        return self._begin.value

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool | None:
        try:
            return self._begin.context.__exit__(kind, error, trace)
        finally:
            restore_environment(self._outer)


_kept: dict[Key, Begin[Any]] = {}
_forked = False


def shareable(make: Callable[P, AbstractContextManager[RunT]]) -> Callable[P, AbstractContextManager[RunT]]:
    """Lets a context manager go on from the kept begin with the same arguments, once, in a fork."""

    @functools.wraps(make)
    def made(*args: P.args, **kwargs: P.kwargs) -> AbstractContextManager[RunT]:
        begin = _kept.pop(_key(made, args, kwargs), None) if _forked else None
        return make(*args, **kwargs) if begin is None else _GoingOn(begin)

    return made


def shared(make: Callable[P, AbstractContextManager[Any]], *args: P.args, **kwargs: P.kwargs) -> pytest.MarkDecorator:
    """Marks tests that begin with a ``shareable`` context of these arguments."""
    return pytest.mark.shared.with_args(make, args, kwargs)


def run_forked(item: pytest.Item, make: Callable[..., AbstractContextManager[Any]], args: Any, kwargs: Any) -> Any:
    """Runs a test from the kept begin in a fork. Returns the report."""
    key = _key(make, args, kwargs)
    if key not in _kept:
        _kept[key] = _begin(make(*args, **kwargs))
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        _run_and_leave(item, writing)
    os.close(writing)
    try:
        with open(reading, "rb") as pipe:
            data = pipe.read()
    except BaseException:  # the test's limit; pytest's fault handler shows where the fork is
        os.kill(pid, signal.SIGABRT)
        raise
    finally:
        _, status = os.waitpid(pid, 0)
        _kept[key].files.restore()
    if not data:
        raise FailedInFork(f"the fork ended with {os.waitstatus_to_exitcode(status)} and without a report")
    return item.config.hook.pytest_report_from_serializable(config=item.config, data=pickle.loads(data))


def close_all() -> None:
    """Ends the kept begins."""
    while _kept:
        _, begin = _kept.popitem()
        with _GoingOn(begin):
            begin.files.forget()


def is_forked() -> bool:
    return _forked


def _run_and_leave(item: pytest.Item, pipe: int) -> None:
    global _forked
    _forked = True
    try:
        call = pytest.CallInfo.from_call(lambda: item.ihook.pytest_runtest_call(item=item), "call")
        report = item.ihook.pytest_runtest_makereport(item=item, call=call)
        data = pickle.dumps(item.config.hook.pytest_report_to_serializable(config=item.config, report=report))
        with open(pipe, "wb") as file:
            file.write(data)
    finally:
        os._exit(0)  # the session and its ends belong to the parent


def _begin(context: AbstractContextManager[RunT]) -> Begin[RunT]:
    outer, threads = dict(os.environ), threading.active_count()
    try:
        value = context.__enter__()
        if threading.active_count() > threads:
            raise RuntimeError("the run has threads of its own, which a fork would lose: parallel=False")
        environment = {name: text for name, text in os.environ.items() if outer.get(name) != text}
    finally:
        restore_environment(outer)
    return Begin(context, value, environment, Files([value.stack.folder, value.stack.scheduler.runtime_folder]))


def _key(make: Callable[..., Any], args: Any, kwargs: Any) -> Key:
    return (make, args, tuple(sorted(kwargs.items())))
