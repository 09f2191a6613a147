"""Permissions, the dead-man pad, message floods, and two operators at once."""

from __future__ import annotations

import json
import random

import pytest

from robot_stack.core.geometry import Twist2
from robot_stack.ui import desk as d
from robot_stack.ui import protocol as p
from robot_stack.ui.access import Access
from robot_stack.ui.pad import STILL, DeadManPad
from robot_stack.ui.params import TouchUiParams
from tests.unit.ui.test_protocol import GOOD, mutate

STAFF, RIDER, OTHER = 1, 2, 3


def say(text: str) -> p.ClientMessage:
    return p.parse(text)


def pad(at_ms: float, x: float = 1.0, y: float = 0.0, turn: float = 0.0) -> p.ClientMessage:
    return say(json.dumps({"t": "pad", "x": x, "y": y, "turn": turn, "at_ms": at_ms}))


@pytest.fixture
def desk(params: TouchUiParams) -> d.Desk:
    desk = d.Desk(Access(params.access), DeadManPad(params.pad), params.server.messages_hz_max)
    desk.access.admit(STAFF, 0.0)
    return desk


RIDERS_MAY = (
    "alive", "stop", "start", "pause", "resume", "abort", "queue_release", "language",
    "login", "logout", "ready", "lift",
)  # fmt: skip
RIDERS_MAY_ASK = ({"t": "show", "layers": []}, {"t": "show", "layers": ["plan"]}, {"t": "call", "on": True})
ASKED = [*(fields for fields, _ in GOOD), {"t": "show", "layers": ["plan"]}, {"t": "call", "on": False}]


@pytest.mark.parametrize("fields", ASKED, ids=lambda fields: fields["t"])
def test_riders_ride_and_staff_operate(desk: d.Desk, fields: dict[str, object]) -> None:
    ruling = desk.take(RIDER, say(json.dumps(fields)), 0.0)
    allowed = fields["t"] in RIDERS_MAY or fields in RIDERS_MAY_ASK
    assert (ruling.why == d.NEEDS_STAFF) is not allowed
    desk.access.end_check(RIDER, True, 0.0)
    assert desk.take(STAFF, say(json.dumps(fields)), 0.0).why == d.OK


def test_a_flood_is_refused_but_for_the_stop(desk: d.Desk, params: TouchUiParams) -> None:
    limit = int(params.server.messages_hz_max)
    rulings = [desk.take(RIDER, say('{"t": "alive"}'), 0.0).why for _ in range(10 * limit)]
    assert rulings.count(d.OK) == limit
    assert rulings[-1] == d.SLOW_DOWN
    stop = desk.take(RIDER, say('{"t": "stop"}'), 0.0)
    assert isinstance(stop.effect, p.Stop)
    assert desk.take(OTHER, say('{"t": "alive"}'), 0.0).why == d.OK  # other pages are not affected
    assert desk.take(RIDER, say('{"t": "alive"}'), 1.0).why == d.OK


def test_login_without_pin_or_while_locked(desk: d.Desk, params: TouchUiParams) -> None:
    login = say('{"t": "login", "pin": "1111"}')
    assert desk.take(RIDER, login, 0.0).effect == login
    assert desk.take(OTHER, login, 0.0).why == d.WAIT  # one check at a time
    for _ in range(params.access.tries):
        desk.access.end_check(RIDER, False, 0.0)
        desk.access.begin_check(RIDER, 0.0)
    assert desk.take(OTHER, login, 1.0).why == d.WAIT
    without = params.access.model_copy(update={"pin_hash": ""})
    locked = d.Desk(Access(without), DeadManPad(params.pad), params.server.messages_hz_max)
    assert locked.take(RIDER, login, 0.0).why == d.NO_PIN_SET


def test_audit_log_records_operator_actions(desk: d.Desk) -> None:
    for text, what in (
        ('{"t": "stop"}', "emergency stop"),
        ('{"t": "start", "mission": "tour"}', "start mission tour"),
        ('{"t": "cancel_goal"}', "cancel goal"),
        ('{"t": "goal", "x": 1, "y": 2, "yaw": 0}', "goal 1.00 2.00 0.000"),
        ('{"t": "call", "on": true}', "staff called"),
        ('{"t": "call", "on": false}', "call answered"),
        ('{"t": "zone_delete", "name": "lawn", "revision": ""}', ""),  # its outcome is
        ('{"t": "self_test", "act": "begin"}', "self test: begin"),
        ('{"t": "self_test", "act": "fail", "step": 3}', "self test: fail step 3"),
        ('{"t": "order", "mission": "site_ride"}', "order site_ride"),
        ('{"t": "order", "mission": "site_ride", "now": true}', "change destination to site_ride"),
        ('{"t": "order_up", "order": "a"}', "order up a"),
        ('{"t": "queue_release"}', "queue release"),
        ('{"t": "alive"}', ""),
        ('{"t": "login", "pin": "2468"}', ""),  # the outcome is logged later, the PIN never
    ):
        assert desk.take(STAFF, say(text), 0.0).audit == what
    assert desk.take(STAFF, pad(0.0), 0.0).audit == "pad pressed"
    assert desk.take(STAFF, pad(50.0), 0.05).audit == ""
    assert desk.take(STAFF, say('{"t": "lift"}'), 0.1).audit == "pad released"
    assert desk.take(STAFF, say('{"t": "lift"}'), 0.1).effect is None


def test_the_pad_drives_while_the_finger_is_there(desk: d.Desk, params: TouchUiParams) -> None:
    assert desk.pad.command(0.0) is None
    desk.take(STAFF, pad(0.0, 0.5), 0.0)
    assert desk.pad.command(0.01) == Twist2(0.5 * params.pad.linear_mps, 0.0, 0.0)
    desk.take(STAFF, say('{"t": "lift"}'), 0.02)
    assert desk.pad.command(0.03) == STILL
    assert desk.pad.command(0.08) is None


def test_after_an_emergency_stop_a_finger_begins_with_a_standstill(desk: d.Desk, params: TouchUiParams) -> None:
    desk.take(STAFF, pad(0.0), 0.0)
    desk.pad.stopped()
    assert desk.pad.command(0.01) == Twist2(params.pad.linear_mps, 0.0, 0.0)  # ignored by the drive
    desk.take(STAFF, say('{"t": "lift"}'), 0.02)
    desk.take(STAFF, pad(1000.0), 1.0)
    assert [desk.pad.command(now_s) for now_s in (1.01, 1.05, 1.09)] == [STILL] * 3
    assert desk.pad.command(1.11) == Twist2(params.pad.linear_mps, 0.0, 0.0)


def test_silence_is_a_stop(desk: d.Desk, params: TouchUiParams) -> None:
    desk.take(STAFF, pad(0.0), 0.0)
    assert desk.pad.command(params.pad.stale_s) != STILL
    assert desk.pad.command(params.pad.stale_s + 0.001) == STILL
    assert desk.pad.holder is None
    assert desk.pad.command(1.0) is None


@pytest.mark.parametrize("how", ["leave", "logout"])
def test_a_page_that_leaves_or_logs_out_releases_the_pad(desk: d.Desk, how: str) -> None:
    desk.take(STAFF, pad(0.0), 0.0)
    if how == "leave":
        desk.leave(STAFF)
    else:
        desk.take(STAFF, say('{"t": "logout"}'), 0.01)
    assert desk.pad.command(0.02) == STILL
    assert desk.take(STAFF, pad(0.0), 0.02).why == d.NEEDS_STAFF  # its session has ended


def test_messages_that_a_stalled_link_delivers_late_do_not_drive(desk: d.Desk) -> None:
    for tick in range(5):
        desk.take(STAFF, pad(50.0 * tick), 0.05 * tick)
    assert desk.pad.command(0.21) is not None
    for tick in range(5, 25):  # 1 s of messages arrives at once, 1.3 s after the first of them was sent
        desk.take(STAFF, pad(50.0 * tick), 1.55)
        now = desk.pad.command(1.55)
        if tick < 1e3 * (1.55 - 0.201) / 50.0:
            assert now in (STILL, None), f"message of {50 * tick} ms moved the robot"
    # a page whose messages are on time again drives again
    desk.take(STAFF, pad(1600.0), 1.60)
    assert desk.pad.command(1.61) not in (STILL, None)


def test_clocks_may_drift(desk: d.Desk) -> None:
    """A drift of 0.1 % of the page's clock is 3.6 s after an hour."""
    for tick in range(1000):
        now_s = 1.0 * tick
        assert desk.pad.press(STAFF, 1.0, 0.0, 0.0, now_s * 0.9991, now_s)
        assert desk.pad.command(now_s) not in (STILL, None)


def test_two_operators_at_once(desk: d.Desk) -> None:
    desk.access.admit(OTHER, 0.0)
    desk.take(STAFF, pad(0.0), 0.0)
    assert desk.take(OTHER, pad(0.0, -1.0), 0.05).why == d.PAD_BUSY
    assert desk.pad.command(0.06) is not None
    assert desk.pad.holder == STAFF
    desk.take(OTHER, say('{"t": "lift"}'), 0.1)
    assert desk.pad.holder == STAFF
    desk.take(STAFF, say('{"t": "lift"}'), 0.11)
    assert desk.take(OTHER, pad(120.0, -1.0), 0.12).why == d.OK
    assert desk.pad.holder == OTHER


def test_diagonal_pad_command_is_scaled_down(desk: d.Desk, params: TouchUiParams) -> None:
    desk.take(STAFF, pad(0.0, 1.0, 1.0, -1.0), 0.0)
    twist = desk.pad.command(0.01)
    assert twist.vx == pytest.approx(params.pad.linear_mps / 2**0.5)
    assert twist.vy == pytest.approx(params.pad.lateral_mps / 2**0.5)
    assert twist.omega == -params.pad.angular_radps


def test_whatever_a_rider_sends_moves_nothing_and_opens_nothing(desk: d.Desk) -> None:
    """2,000 mutated messages from a page without staff rights: no pad, no pose, no goal, no reset."""
    draw = random.Random(7)
    originals = [json.dumps(fields).encode() for fields, _ in GOOD]
    for tick in range(2000):
        try:
            message = p.parse(mutate(draw.choice(originals), draw))
        except p.Refused:
            continue
        effect = desk.take(RIDER, message, 0.1 * tick).effect
        assert not isinstance(effect, p.Pad | p.Pose | p.Goal | p.CancelGoal | p.Reset | p.ClearStop | p.SelfTest)
        assert desk.pad.command(0.1 * tick) is None


def test_a_hold_of_the_staff_is_released_with_the_pin_only(desk: d.Desk) -> None:
    release = say('{"t": "queue_release"}')
    assert desk.take(RIDER, release, 0.0).why == d.OK
    assert desk.take(RIDER, release, 0.0, held_by_staff=True).why == d.NEEDS_STAFF
    assert desk.take(STAFF, release, 0.0, held_by_staff=True).why == d.OK
