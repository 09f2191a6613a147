"""Subscriptions follow the clients that watch a topic."""

from __future__ import annotations

import random

from robot_stack.contract.model import System
from robot_stack.view.channels import MODEL, MODEL_INPUTS, offered
from robot_stack.view.watching import Change, Watching

ROWS = offered(System.ROBOT)
VOLATILE, LATCHED = "/odom", "/plan"


def test_first_look_subscribes_and_the_last_one_leaving_ends_it() -> None:
    watching = Watching(ROWS)
    assert watching.begin(1, VOLATILE) == Change(begin=(VOLATILE,))
    assert watching.begin(2, VOLATILE) == Change()
    assert watching.end(1, VOLATILE) == Change()
    assert watching.end(2, VOLATILE) == Change(end=(VOLATILE,))
    assert watching.topics == frozenset()
    assert watching.begin(1, LATCHED) == Change(begin=(LATCHED,))
    assert watching.begin(2, LATCHED) == Change(end=(LATCHED,), begin=(LATCHED,)), "for what is latched"
    for nothing in (watching.begin(1, "/nowhere"), watching.end(1, "/nowhere"), watching.end(7, VOLATILE)):
        assert nothing == Change()


def test_the_model_needs_its_topics_and_shares_them() -> None:
    watching = Watching(ROWS)
    joints, *others = (row.name for row in MODEL_INPUTS)
    assert watching.begin(1, MODEL) == Change(begin=tuple(sorted((joints, *others))))
    assert watching.looked_at(MODEL)
    assert watching.begin(2, joints) == Change()
    assert watching.end(1, MODEL) == Change(end=tuple(sorted(others)))
    assert not watching.looked_at(MODEL)
    assert watching.topics == {joints}


def test_applied_changes_equal_watched_topics() -> None:
    """Clients come and go in any order. A change is applied to a set as the node applies it to its subscriptions."""
    draw = random.Random(1)
    channels = [VOLATILE, LATCHED, MODEL, *(row.name for row in MODEL_INPUTS)]
    watching, subscribed, looking = Watching(ROWS), set[str](), set[tuple[int, str]]()
    for _ in range(2000):
        client, channel = draw.randrange(4), draw.choice(channels)
        looks = draw.random() < 0.5
        change = watching.begin(client, channel) if looks else watching.end(client, channel)
        (looking.add if looks else looking.discard)((client, channel))
        assert set(change.end) <= subscribed
        subscribed -= set(change.end)
        assert not set(change.begin) & subscribed
        subscribed |= set(change.begin)
        wanted = {name for _, name in looking if name != MODEL}
        if any(name == MODEL for _, name in looking):
            wanted |= {row.name for row in MODEL_INPUTS}
        assert subscribed == wanted == watching.topics
