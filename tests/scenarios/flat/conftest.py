"""One stack for all modules of this folder, reset before every test: a start takes longer than most tests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.support.environment import stack_environment

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest


@pytest.fixture(scope="package")
def flat_stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StackUnderTest]:
    folder = tmp_path_factory.mktemp("stack")
    with stack_environment(folder):
        from tests.support.stack import FLAT, StackUnderTest

        stack = StackUnderTest(folder / "logs", *FLAT)
        yield stack
        stack.close()


@pytest.fixture
def stack(flat_stack: StackUnderTest) -> StackUnderTest:
    flat_stack.make_ready()
    return flat_stack
