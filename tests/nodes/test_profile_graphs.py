"""Running stacks of all profiles except the simulated robot's against the contract, in real time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_stack.contract.model import System
from robot_stack.core.config import config_dir
from robot_stack.supervisor.profile import Plan, load_plan
from robot_stack.wmx.config import ENGINE_VARIABLE
from tests.support.environment import stack_environment
from tests.support.graph import PEER, assert_graph_is_the_contracts

PROFILES = tuple(sorted(path.stem for path in (config_dir() / "profiles").glob("*.yaml")))
SIMULATED_ROBOTS = (
    "sim",
    "robot_simulated",
)  # tests/scenarios/flat/test_graph.py, tests/scenarios/test_robot_profile.py
WITHOUT_COMMUNICATION = ("general",)  # none of its nodes starts it


def start_communication() -> None:
    """Starts communication like an operator; before that the axes have no state to publish."""
    from std_srvs.srv import SetBool

    from robot_stack.contract import services
    from tests.support.peer import Peer

    peer = Peer(PEER)
    try:
        assert peer.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)).success
    finally:
        peer.close()


@pytest.fixture
def running(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Plan]:
    """The plan of a profile that the supervisor has started."""
    plan = load_plan(request.param)
    if plan.environment.get(ENGINE_VARIABLE) == "vendor":
        pytest.skip("needs the vendor's motion engine and its hardware")
    with stack_environment(tmp_path):
        from robot_stack.supervisor import client

        try:
            client.start(client.Launch(plan.name, log_dir=tmp_path / "logs"), 90.0)
            yield plan
        finally:
            client.stop()


@pytest.mark.parametrize("running", [name for name in PROFILES if name not in SIMULATED_ROBOTS], indirect=True)
def test_rows_and_the_other_running_profiles_are_the_same(running: Plan) -> None:
    assert running.machine is System.WMX
    assert not running.missing
    if running.name in WITHOUT_COMMUNICATION:
        start_communication()
    assert_graph_is_the_contracts(running)
