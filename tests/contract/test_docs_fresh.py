"""``docs/interfaces.md`` matches the contract."""

from __future__ import annotations

from robot_stack.contract import actions, docs, faults, processes, services, topics


def test_document_is_fresh() -> None:
    committed = docs.PATH.read_text(encoding="utf-8")
    assert committed == docs.render(), "run python -m robot_stack.contract.docs and commit docs/interfaces.md"


def test_every_row_is_in_the_document() -> None:
    text = docs.render()
    rows = (*topics.TOPICS, *services.SERVICES, *actions.ACTIONS, *processes.PROCESSES)
    assert [row.name for row in rows if f"| `{row.name}` |" not in text] == []
    assert [row.code for row in faults.FAULTS if f"| `{row.code}` |" not in text] == []


def test_every_table_line_has_its_columns() -> None:
    width = 0
    for line in docs.render().splitlines():
        cells = line.count("|") - 1
        if not line.startswith("|"):
            width = 0
        elif width == 0:
            width = cells
        else:
            assert cells == width, line
