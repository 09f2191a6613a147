"""PINs, sessions and permitted origins of pages."""

from __future__ import annotations

import pytest

from robot_stack.core.config import ConfigError, load, validate
from robot_stack.ui.access import Access, PinTries, Role
from robot_stack.ui.origin import Gate
from robot_stack.ui.params import ServerParams, TouchUiParams
from robot_stack.ui.pin import hash_pin, verify_pin

TOKEN = "t" * 32


def test_a_pin_is_known_by_its_hash_alone() -> None:
    pin_hash = hash_pin("2468")
    assert "2468" not in pin_hash
    assert verify_pin(pin_hash, "2468")
    assert not verify_pin(pin_hash, "2469")
    assert not verify_pin("", "2468")
    assert not verify_pin("$argon2id$nonsense", "2468")


@pytest.mark.parametrize("pin", ["", "123", "12a4", "１２３４", "1" * 13])
def test_invalid_pin_is_not_hashed(pin: str) -> None:
    with pytest.raises(ValueError, match="digits"):
        hash_pin(pin)


def test_each_row_of_wrong_pins_locks_for_longer() -> None:
    tries = PinTries(3, 10.0, 25.0)
    now_s = 0.0
    for wait_s in (10.0, 20.0, 25.0, 25.0):
        for _ in range(3):
            assert tries.wait_s(now_s) == 0.0
            tries.tried(False, now_s)
        assert tries.wait_s(now_s) == wait_s
        now_s += wait_s
    tries.tried(True, now_s)
    for _ in range(2):
        tries.tried(False, now_s)
    assert tries.wait_s(now_s) == 0.0  # the correct PIN started a new series


def try_wrong(access: Access, client: int, now_s: float, times: int) -> None:
    for _ in range(times):
        assert access.begin_check(client, now_s)
        access.end_check(client, False, now_s)


def test_another_page_gives_no_further_tries(params: TouchUiParams) -> None:
    access, tries = Access(params.access), params.access.tries
    for client in range(tries):
        access.enter(client, 0.0)
        try_wrong(access, client, 0.0, 1)
        access.leave(client)
    access.enter(tries, 0.0)
    assert access.wait_s(tries, 0.0) == params.access.lock_s
    assert not access.begin_check(tries, 0.0)


def test_wrong_pins_on_other_pages_do_not_lock_a_page_that_has_long_been_open(params: TouchUiParams) -> None:
    access, old_s = Access(params.access), params.access.lock_max_s
    access.enter(1, 0.0)
    access.enter(2, old_s)
    now_s = old_s
    for _ in range(40 // params.access.tries):
        try_wrong(access, 2, now_s, params.access.tries)
        assert access.wait_s(2, now_s) > 0.0
        assert access.wait_s(1, now_s) == 0.0
        now_s += access.wait_s(2, now_s)
    assert access.begin_check(1, now_s)
    access.end_check(1, True, now_s)
    assert access.role(1, now_s) is Role.STAFF


def test_no_row_of_wrong_pins_locks_for_longer_than_five_minutes(params: TouchUiParams) -> None:
    access, now_s = Access(params.access), 0.0
    access.enter(1, now_s)
    for _ in range(40 // params.access.tries):
        try_wrong(access, 1, now_s, params.access.tries)
        assert access.wait_s(1, now_s) <= 300.0
        now_s += access.wait_s(1, now_s)


def test_a_page_that_closed_while_its_pin_was_checked_is_not_staff(params: TouchUiParams) -> None:
    access = Access(params.access)
    access.enter(1, 0.0)
    assert access.begin_check(1, 0.0)
    access.leave(1)
    access.end_check(1, True, 0.0)
    assert access.role(1, 0.0) is Role.RIDER


def test_sessions_end(params: TouchUiParams) -> None:
    idle_s, session_s = params.access.idle_s, params.access.session_s
    access = Access(params.access)
    assert access.role(1, 0.0) is Role.RIDER
    access.admit(1, 0.0)
    assert access.role(1, idle_s - 0.1) is Role.STAFF
    assert access.role(2, 0.0) is Role.RIDER
    assert access.role(1, idle_s) is Role.RIDER
    access.admit(1, 0.0)
    now_s = 0.0
    while now_s < session_s:
        assert access.role(1, now_s) is Role.STAFF
        access.touch(1, now_s)
        now_s += 0.5 * idle_s
    assert access.role(1, now_s) is Role.RIDER
    access.touch(1, now_s)  # a rider's touch gives no staff role
    assert access.role(1, now_s) is Role.RIDER
    access.admit(1, 100.0)
    assert access.role(1, 99.0) is Role.RIDER  # the clock jumped backwards
    access.admit(1, 0.0)
    access.dismiss(1)
    assert access.role(1, 0.0) is Role.RIDER


def server(**changes: object) -> ServerParams:
    plain = load(TouchUiParams, "touch_ui").server.model_dump()
    return validate(ServerParams, {**plain, **changes}, "touch_ui")


def test_beyond_this_machine_only_with_certificate_and_token() -> None:
    with pytest.raises(ConfigError, match="can be reached from outside") as refusal:
        server(address="0.0.0.0")
    assert "\n" not in str(refusal.value)
    for missing in ("tls_certificate", "tls_key", "token"):
        protection = {"tls_certificate": "c.pem", "tls_key": "k.pem", "token": TOKEN, missing: ""}
        with pytest.raises(ConfigError):
            server(address="192.168.1.5", **protection)
    assert not server(address="0.0.0.0", tls_certificate="c.pem", tls_key="k.pem", token=TOKEN).loopback
    assert server(address="::1").loopback
    for wrong in ({"address": "robot.local"}, {"token": "short"}, {"host_names": ["a b"]}):
        with pytest.raises(ConfigError):
            server(**wrong)


def test_gate_accepts_only_own_origin() -> None:
    gate = Gate(server(), 8460)
    assert gate.origin("http://127.0.0.1:8460", "127.0.0.1:8460")
    assert gate.origin("http://localhost:8460", "localhost:8460")
    for origin, host in (
        (None, "127.0.0.1:8460"),
        ("null", "127.0.0.1:8460"),
        ("http://evil.example", "127.0.0.1:8460"),
        ("http://evil.example:8460", "evil.example:8460"),  # a foreign name that resolves to this host
        ("http://127.0.0.1:9999", "127.0.0.1:8460"),
        ("https://127.0.0.1:8460", "127.0.0.1:8460"),
        ("http://localhost:8460", "127.0.0.1:8460"),
        ("http://127.0.0.1:8460.evil.example", "127.0.0.1:8460"),
        ("http://127.0.0.1:8460", None),
        ("http://127.0.0.1:8460", "127.0.0.1"),
    ):
        assert not gate.origin(origin, host), (origin, host)
    assert gate.token(None)
    assert not gate.needs_token


def test_gate_with_token_rejects_missing_or_wrong_token() -> None:
    params = server(address="192.168.1.5", tls_certificate="c", tls_key="k", token=TOKEN, host_names=["robot.example"])
    gate = Gate(params, 443)
    assert gate.needs_token
    assert gate.token(TOKEN)
    for wrong in (None, "", TOKEN[:-1], TOKEN + "t", "ü" * 32):
        assert not gate.token(wrong)
    assert gate.origin("https://robot.example", "robot.example")
    assert gate.origin("https://192.168.1.5:443", "192.168.1.5:443")
