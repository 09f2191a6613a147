"""No modules import each other in a circle, not even inside functions or for type checking alone."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(tree: ast.Module, modules: Mapping[str, Path]) -> Iterator[str]:
    """The modules among ``modules`` that any import statement of a module names."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found = inner if inner in modules else node.module
                if found in modules:
                    yield found


def circle(modules: Mapping[str, Path]) -> list[str]:
    """The modules of a circle, in its order; none if there is none."""
    graph = {
        name: set(imported(ast.parse(path.read_text(encoding="utf-8")), modules)) - {name}
        for name, path in modules.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_import_goes_round() -> None:
    modules = {
        module_name(path): path
        for package in ("robot_stack", "sim", "tests")
        for path in (ROOT / package).rglob("*.py")
    }
    assert len(modules) > 500
    assert circle(modules) == []


@pytest.mark.parametrize(
    "statement",
    ["import b", "from b import x", "def f():\n    from b import x", "if TYPE_CHECKING:\n    from b import x"],
)
def test_a_circle_is_seen_wherever_the_import_stands(tmp_path: Path, statement: str) -> None:
    modules = {"a": tmp_path / "a.py", "b": tmp_path / "b.py"}
    modules["a"].write_text(f"{statement}\n", encoding="utf-8")
    modules["b"].write_text("import a\n", encoding="utf-8")
    assert set(circle(modules)) == {"a", "b"}
    modules["b"].write_text("\n", encoding="utf-8")
    assert circle(modules) == []
