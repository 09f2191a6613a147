"""The committed layout uses only what the live view offers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from robot_stack.contract.model import System
from robot_stack.core.config import config_dir
from robot_stack.view.channels import MODEL, offered

LAYOUT = json.loads((config_dir() / "foxglove_layout.json").read_text())


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def topics_of(value: Any) -> Iterator[str]:
    """Returns the names of topics, and of message paths up to the first field."""
    match value:
        case dict():
            for key, item in value.items():
                yield from topics_of(key)
                yield from topics_of(item)
        case list():
            for item in value:
                yield from topics_of(item)
        case str() if value.startswith("/"):
            yield value.partition(".")[0]


def test_every_panel_that_is_shown_is_configured() -> None:
    assert sorted(panels(LAYOUT["layout"])) == sorted(LAYOUT["configById"])


def test_every_topic_is_offered() -> None:
    named = set(topics_of(LAYOUT["configById"]))
    assert named <= {*offered(System.ROBOT), MODEL}
    assert {MODEL, "/plan", "/docking/target", "/sensors/camera/front/image_raw"} <= named
