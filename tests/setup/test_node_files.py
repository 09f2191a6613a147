"""A node is ``<Node>Node`` in ``<subsystem>/nodes/<node>.py``, and short: what it does in the end lies in kernels."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "robot_stack"
FEWER_LINES_THAN = 150
# Nodes that are longer, each with the reason in a comment. The list only shrinks: who shortens a node takes it off.
STILL_LONGER: set[str] = set()


def node_classes(source: str) -> list[str]:
    """The classes ``<Node>Node`` that derive from StackNode or from another node."""
    return [
        item.name
        for item in ast.walk(ast.parse(source))
        if isinstance(item, ast.ClassDef)
        and item.name.endswith("Node")
        and any(ast.unparse(base).endswith("Node") for base in item.bases)
    ]


def nodes(package: Path) -> Iterator[tuple[str, str, list[str]]]:
    """(file, text, node classes) of every file with a node."""
    for path in sorted(package.glob("*/nodes/*.py")):
        text = path.read_text(encoding="utf-8")
        if classes := node_classes(text):
            yield path.relative_to(package).as_posix(), text, classes


def class_of(file: str) -> str:
    name = "".join(part.capitalize() for part in Path(file).stem.split("_"))
    return name if name.endswith("Node") else f"{name}Node"


def complaints(lines: Mapping[str, int], still_longer: set[str]) -> list[str]:
    """lines: of every node's file."""
    longer = {file for file, count in lines.items() if count >= FEWER_LINES_THAN}
    return [
        *(f"{file} has {lines[file]} lines" for file in sorted(longer - still_longer)),
        *(f"{file} is short by now: take it off the list" for file in sorted(still_longer - longer)),
    ]


def test_nodes_are_short() -> None:
    lines = {file: len(text.splitlines()) for file, text, _ in nodes(PACKAGE)}
    assert len(lines) > 20
    assert complaints(lines, STILL_LONGER) == []


def test_a_node_is_found_by_its_name() -> None:
    others = {file: classes for file, _, classes in nodes(PACKAGE) if classes != [class_of(file)]}
    assert others == {}


@pytest.mark.parametrize(
    ("count", "listed", "expected"),
    [
        (149, set(), []),
        (150, set(), ["a/nodes/b.py has 150 lines"]),
        (150, {"a/nodes/b.py"}, []),
        (149, {"a/nodes/b.py"}, ["a/nodes/b.py is short by now: take it off the list"]),
        (149, {"a/nodes/gone.py"}, ["a/nodes/gone.py is short by now: take it off the list"]),
    ],
)
def test_the_list_holds_what_is_longer_and_nothing_else(count: int, listed: set[str], expected: list[str]) -> None:
    assert complaints({"a/nodes/b.py": count}, listed) == expected


def test_nodes_of_every_kind_are_seen(tmp_path: Path) -> None:
    folder = tmp_path / "drivers/nodes"
    folder.mkdir(parents=True)
    (folder / "lidar.py").write_text("class LidarNode(StackNode): ...\n", encoding="utf-8")
    (folder / "other_lidar.py").write_text("class OtherLidarNode(lidar.LidarNode): ...\n", encoding="utf-8")
    (folder / "reader.py").write_text("class Reader: ...\nclass FakeNode(Protocol): ...\n", encoding="utf-8")
    (folder / "hidden.py").write_text("def f():\n    class WrongNode(StackNode): ...\n", encoding="utf-8")
    found = {Path(file).name: classes for file, _, classes in nodes(tmp_path)}
    assert found == {"lidar.py": ["LidarNode"], "other_lidar.py": ["OtherLidarNode"], "hidden.py": ["WrongNode"]}
