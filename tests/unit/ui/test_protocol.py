"""Messages of pages: which are accepted, which are rejected, and that nothing else happens."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest

from robot_stack.ui import protocol as p

GOOD: tuple[tuple[dict[str, Any], type], ...] = (
    ({"t": "alive"}, p.Alive),
    ({"t": "show", "layers": []}, p.Show),
    ({"t": "show", "layers": ["plan", "costmap"]}, p.Show),
    ({"t": "ready", "layer": "front_image"}, p.Ready),
    ({"t": "stop", "id": 3}, p.Stop),
    ({"t": "reset"}, p.Reset),
    ({"t": "clear_stop", "source": "operator_panel"}, p.ClearStop),
    ({"t": "start", "mission": "site_ride"}, p.Start),
    ({"t": "pause"}, p.Ride),
    ({"t": "resume"}, p.Ride),
    ({"t": "abort"}, p.Ride),
    ({"t": "order", "mission": "site_ride", "priority": 200, "in_min": 15}, p.AddOrder),
    ({"t": "order", "mission": "site_ride", "now": True}, p.AddOrder),
    ({"t": "order_up", "order": "start_1"}, p.ChangeOrder),
    ({"t": "order_down", "order": "注文 1"}, p.ChangeOrder),
    ({"t": "order_remove", "order": "start_1"}, p.ChangeOrder),
    ({"t": "queue_hold"}, p.Queue),
    ({"t": "queue_release"}, p.Queue),
    ({"t": "language", "code": "zh"}, p.Language),
    ({"t": "login", "pin": "2468"}, p.Login),
    ({"t": "logout"}, p.Logout),
    ({"t": "pad", "x": 1, "y": -0.5, "turn": 0.0, "at_ms": 12.5}, p.Pad),
    ({"t": "lift"}, p.Lift),
    ({"t": "pose", "x": 1.0, "y": 2, "yaw": -3.1}, p.Pose),
    ({"t": "goal", "x": 1.0, "y": 2, "yaw": 0}, p.Goal),
    ({"t": "cancel_goal"}, p.CancelGoal),
    ({"t": "undock"}, p.Undock),
    ({"t": "confirm_door", "name": "hall"}, p.ConfirmDoor),
    ({"t": "call", "on": True}, p.CallStaff),
    (
        {"t": "mission_check", "mission": {"id": "tour", "waypoints": [{"x": 1.5, "action": {"wait": 5}}]}},
        p.CheckMission,
    ),
    ({"t": "mission_save", "mission": {"id": "tour"}, "was": "", "revision": ""}, p.SaveMission),
    ({"t": "mission_delete", "mission": "tour", "revision": "0123456789abcdef"}, p.DeleteMission),
    (
        {"t": "zone_save", "name": "lawn", "type": "keepout", "points": [[0, 0], [2, 0], [2, 1.5]], "revision": ""},
        p.SaveZone,
    ),
    ({"t": "zone_delete", "name": "lawn", "revision": "0123456789abcdef"}, p.DeleteZone),
    ({"t": "lane_save", "points": [[0, 0], [2, 0.5]], "both": True, "revision": ""}, p.DrawLane),
    ({"t": "lane_delete", "lane": "9223372036854775807", "revision": ""}, p.DeleteLane),
    ({"t": "self_test", "act": "begin"}, p.SelfTest),
    ({"t": "self_test", "act": "confirm", "step": 3}, p.SelfTest),
)

BAD = (
    "",
    "stop",
    '{"t": 1}',
    '{"t": "STOP"}',
    '{"t": "stop", "extra": 1}',
    '{"t": "stop", "id": -1}',
    '{"t": "stop", "id": "1"}',
    '{"t": "stop", "id": true}',
    '{"t": "start"}',
    '{"t": "start", "mission": "../../etc/passwd"}',
    '{"t": "order", "mission": "site_ride", "priority": 256}',
    '{"t": "order", "mission": "site_ride", "in_min": -1}',
    '{"t": "order", "mission": "site_ride", "now": 1}',
    '{"t": "order_up", "order": "' + "x" * 65 + '"}',
    '{"t": "pad", "x": NaN, "y": 0, "turn": 0, "at_ms": 0}',
    '{"t": "pad", "x": 1e400, "y": 0, "turn": 0, "at_ms": 0}',
    '{"t": "pad", "x": 1.01, "y": 0, "turn": 0, "at_ms": 0}',
    '{"t": "pad", "x": 0, "y": 0, "turn": 0}',
    '{"t": "goal", "x": 10001, "y": 0, "yaw": 0}',
    '{"t": "goal", "x": Infinity, "y": 0, "yaw": 0}',
    '{"t": "goal", "x": 0, "y": 0, "yaw": 90}',
    '{"t": "language", "code": "fr"}',
    '{"t": "login", "pin": "123"}',
    '{"t": "login", "pin": "12345678901234"}',
    '{"t": "login", "pin": "１２３４"}',
    '{"t": "call", "on": 1}',
    '{"t": "show", "layers": ["everything"]}',
    '{"t": "show", "layers": ' + json.dumps(["plan"] * (len(p.Layer) + 1)) + "}",
    '{"t": "mission_check", "mission": []}',
    '{"t": "mission_save", "mission": {}, "was": "../tour", "revision": ""}',
    '{"t": "mission_save", "mission": {}, "was": "tour", "revision": "../../x"}',
    '{"t": "mission_delete", "mission": "", "revision": ""}',
    '{"t": "zone_save", "name": "lawn", "type": "keepout", "points": [[0, 0], [2, 0]], "revision": ""}',
    '{"t": "zone_save", "name": "lawn", "type": "keepout", "points": [[0, 0], [2, 0], [2, 1e9]], "revision": ""}',
    '{"t": "zone_save", "name": "", "type": "keepout", "points": [[0, 0], [2, 0], [2, 1]], "revision": ""}',
    '{"t": "lane_save", "points": [[0, 0]], "both": true, "revision": ""}',
    '{"t": "lane_check", "points": [[0, 0], [2, 1e9]], "both": true, "revision": ""}',
    '{"t": "lane_save", "points": [[0, 0], [2, 0]], "both": true, "speed_limit_mps": 0.05, "revision": ""}',
    '{"t": "lane_delete", "lane": "-1", "revision": ""}',
    '{"t": "zone_save", "name": "lawn", "type": "pit", "points": [[0, 0], [2, 0], [2, 1]], "revision": ""}',
    '{"t": "zone_delete", "name": "lawn", "revision": "../x"}',
    '{"t": "self_test", "act": "reset", "step": 3}',
    '{"t": "self_test", "act": "confirm", "step": -1}',
    '{"t": "self_test", "act": "confirm", "step": 64}',
    '{"t": "stop"} {"t": "stop"}',
    "[" * 4000,
    '{"t": "stop", "id": ' + " " * 4096 + "1}",
    b"\xff\xfe\x00",
    b'{"t": "st\xc3"}',
)


@pytest.mark.parametrize(("fields", "kind"), GOOD)
def test_every_message_of_the_protocol_is_taken(fields: dict[str, Any], kind: type) -> None:
    assert type(p.parse(json.dumps(fields))) is kind
    assert type(p.parse(json.dumps(fields).encode())) is kind


@pytest.mark.parametrize("text", BAD)
def test_everything_else_is_refused(text: str | bytes) -> None:
    with pytest.raises(p.Refused):
        p.parse(text)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        (json.dumps({"t": "zone_save", "points": [[0.0, 0.0]] * 65, "id": 7}), 7),
        (json.dumps({"t": "login", "pin": " " * 4096, "id": 8}), 8),
        ('{"t": "stop", "id": -1}', 0),
        ('{"t": "stop", "id": 1', 0),
        ("[" * 4000, 0),
        (b"\xff", 0),
    ],
)
def test_a_refusal_names_the_message_if_its_number_can_be_read(text: str | bytes, number: int) -> None:
    with pytest.raises(p.Refused) as refused:
        p.parse(text)
    assert refused.value.id == number


def test_every_kind_of_message_is_in_the_list_above() -> None:
    members = {kind for kind in vars(p).values() if isinstance(kind, type) and issubclass(kind, p.Message)}
    assert {kind for _, kind in GOOD} == members - {p.Message}


def mutate(text: bytes, draw: random.Random) -> bytes:
    """Returns a message as a broken or hostile page may send it."""
    data = bytearray(text)
    for _ in range(draw.randint(1, 6)):
        at = draw.randrange(len(data) + 1)
        match draw.randrange(5):
            case 0:
                data.insert(at, draw.randrange(256))
            case 1:
                del data[at : at + draw.randint(1, 8)]
            case 2 if at < len(data):
                data[at] ^= 1 << draw.randrange(8)
            case 3:
                data[at:at] = draw.choice((b'"', b"{", b"\x00", b"-", b"e9999", b"NaN", b"null", b"\\u0000", b"\xf0"))
            case _:
                data[at:at] = data[: draw.randint(0, len(data))]
    return bytes(data)


def test_fuzzed_messages_are_rejected_or_keep_their_type() -> None:
    """10,000 mutants, identical in every run."""
    draw = random.Random(20_251_215)
    originals = [json.dumps(fields).encode() for fields, _ in GOOD]
    taken = refused = 0
    for _ in range(10_000):
        text = mutate(draw.choice(originals), draw)
        try:
            message = p.parse(text)
        except p.Refused:
            refused += 1
            continue
        taken += 1
        assert message.t == json.loads(text)["t"]  # no other type was accepted
    assert refused > 5_000
    assert taken > 50  # enough mutants are valid to be useful
