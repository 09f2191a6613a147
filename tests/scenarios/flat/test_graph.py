"""The running robot against the contract. Profiles without a safety monitor: tests/nodes/test_profile_graphs.py."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robot_stack.supervisor.profile import load_plan
from tests.support.graph import assert_graph_is_the_contracts

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest

pytestmark = pytest.mark.timeout(900)


def test_rows_and_the_running_robot_are_the_same(stack: StackUnderTest) -> None:
    assert_graph_is_the_contracts(load_plan("sim"))
