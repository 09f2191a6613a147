"""A node is the class ``<Node>Node`` in ``<subsystem>/nodes/<node>.py``."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "robot_stack"


def node_classes(source: str) -> list[str]:
    """The classes ``<Node>Node`` that derive from StackNode or from another node."""
    return [
        item.name
        for item in ast.walk(ast.parse(source))
        if isinstance(item, ast.ClassDef)
        and item.name.endswith("Node")
        and any(ast.unparse(base).endswith("Node") for base in item.bases)
    ]


def nodes(package: Path) -> Iterator[tuple[str, list[str]]]:
    """(file, node classes) of every file with a node."""
    for path in sorted(package.glob("*/nodes/*.py")):
        if classes := node_classes(path.read_text(encoding="utf-8")):
            yield path.relative_to(package).as_posix(), classes


def class_of(file: str) -> str:
    name = "".join(part.capitalize() for part in Path(file).stem.split("_"))
    return name if name.endswith("Node") else f"{name}Node"


def test_a_node_is_found_by_its_name() -> None:
    assert len(list(nodes(PACKAGE))) > 20
    others = {file: classes for file, classes in nodes(PACKAGE) if classes != [class_of(file)]}
    assert others == {}


def test_nodes_of_every_kind_are_seen(tmp_path: Path) -> None:
    folder = tmp_path / "drivers/nodes"
    folder.mkdir(parents=True)
    (folder / "lidar.py").write_text("class LidarNode(StackNode): ...\n", encoding="utf-8")
    (folder / "other_lidar.py").write_text("class OtherLidarNode(lidar.LidarNode): ...\n", encoding="utf-8")
    (folder / "reader.py").write_text("class Reader: ...\nclass FakeNode(Protocol): ...\n", encoding="utf-8")
    (folder / "hidden.py").write_text("def f():\n    class WrongNode(StackNode): ...\n", encoding="utf-8")
    found = {Path(file).name: classes for file, classes in nodes(tmp_path)}
    assert found == {"lidar.py": ["LidarNode"], "other_lidar.py": ["OtherLidarNode"], "hidden.py": ["WrongNode"]}
