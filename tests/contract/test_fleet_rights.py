"""The fleet agent moves the robot through the mission manager's queue alone."""

from __future__ import annotations

import ast
from pathlib import Path

from robot_stack.contract import actions, services, topics
from robot_stack.contract.model import EVERY_NODE, Action, Service, Topic
from robot_stack.contract.processes import BY_NAME
from robot_stack.fleet.progress import Operation

NODE = "fleet_agent"
NODES = Path(__file__).resolve().parents[2] / "robot_stack/fleet/nodes"


def rows(module: object, kind: type) -> list[object]:
    return [value for value in vars(module).values() if isinstance(value, kind)]


def called(method: str) -> list[str]:
    """The arguments of all calls of a node's method in the agent's modules, as source text."""
    return [
        ast.unparse(call.args[0])
        for path in sorted(NODES.glob("*.py"))
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == method
        and call.args
    ]


def test_it_publishes_the_initial_pose_and_what_every_node_does() -> None:
    published = {row.name for row in rows(topics, Topic) if isinstance(row, Topic) and NODE in row.publishers}
    assert published == {topics.INITIAL_POSE.name}
    shared = {row.name for row in rows(topics, Topic) if isinstance(row, Topic) and EVERY_NODE in row.publishers}
    assert shared == {"/system/heartbeat", "/diagnostics"}
    assert called("advertise") == ["topics.INITIAL_POSE"]


def test_it_asks_for_no_action_and_serves_nothing() -> None:
    assert [
        row for row in rows(actions, Action) if isinstance(row, Action) and NODE in (row.server, *row.clients)
    ] == []
    assert [row for row in rows(services, Service) if isinstance(row, Service) and row.server == NODE] == []
    assert called("action_client") == called("serve") == called("serve_later") == called("serve_action") == []


def test_it_calls_the_queue_alone_and_releases_nothing() -> None:
    assert called("client") == ["services.EDIT_MISSION_QUEUE"]
    assert {operation.name for operation in Operation} == {"ADD", "EXTEND", "CANCEL", "PAUSE", "RESUME"}


def test_it_runs_in_a_process_of_its_own() -> None:
    assert BY_NAME[NODE].nodes == (NODE,)
