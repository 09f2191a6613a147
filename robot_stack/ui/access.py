"""Roles and rights: riders by default, staff for a time after the PIN. Times are steady seconds."""

from __future__ import annotations

from enum import StrEnum

from robot_stack.ui.params import AccessParams


class Role(StrEnum):
    RIDER = "rider"
    STAFF = "staff"


class PinTries:
    """A wait after each series of wrong PINs, which doubles with every further series."""

    def __init__(self, tries: int, lock_s: float, lock_max_s: float) -> None:
        self._tries, self._lock_s, self._lock_max_s = tries, lock_s, lock_max_s
        self._wrong = 0
        self._rows = 0
        self._locked_until_s = float("-inf")

    def wait_s(self, now_s: float) -> float:
        """Seconds until a PIN is checked again, 0: now."""
        return max(0.0, self._locked_until_s - now_s)

    def tried(self, right: bool, now_s: float) -> None:
        if right:
            self._wrong = self._rows = 0
            return
        self._wrong += 1
        if self._wrong >= self._tries:
            self._wrong = 0
            self._locked_until_s = now_s + min(self._lock_s * 2.0**self._rows, self._lock_max_s)
            self._rows = min(self._rows + 1, 32)


class _Session:
    def __init__(self, now_s: float) -> None:
        self.begun_s = self.used_s = now_s


class Access:
    """The staff sessions, one for each page that gave the PIN; a page that closes ends its own.

    Wrong PINs are counted for each page that has been open for ``lock_max_s``, and for all younger pages together:
    opening another page gives no further tries, and wrong PINs on another page do not lock the robot's own screen.
    """

    def __init__(self, params: AccessParams) -> None:
        self._params = params
        self._sessions: dict[int, _Session] = {}
        self._opened_s: dict[int, float] = {}
        self._young = self._new_tries()
        self._tries: dict[int, PinTries] = {}
        self._checking = False

    @property
    def pin_set(self) -> bool:
        return bool(self._params.pin_hash)

    def enter(self, client: int, now_s: float) -> None:
        """The page has opened."""
        self._opened_s[client] = now_s

    def leave(self, client: int) -> None:
        """The page has closed."""
        self.dismiss(client)
        self._opened_s.pop(client, None)
        self._tries.pop(client, None)

    def begin_check(self, client: int, now_s: float) -> bool:
        """False while the page is locked, or while another PIN is checked."""
        if self._checking or self.wait_s(client, now_s) > 0.0:
            return False
        self._checking = True
        return True

    def end_check(self, client: int, right: bool, now_s: float) -> None:
        self._checking = False
        self._tries_of(client, now_s).tried(right, now_s)
        if right and client in self._opened_s:
            self.admit(client, now_s)

    def wait_s(self, client: int, now_s: float) -> float:
        """Seconds until a PIN from this page is checked again, 0: now."""
        return self._tries_of(client, now_s).wait_s(now_s)

    def _tries_of(self, client: int, now_s: float) -> PinTries:
        if now_s - self._opened_s.get(client, now_s) < self._params.lock_max_s:
            return self._young
        return self._tries.setdefault(client, self._new_tries())

    def _new_tries(self) -> PinTries:
        return PinTries(self._params.tries, self._params.lock_s, self._params.lock_max_s)

    def admit(self, client: int, now_s: float) -> None:
        self._sessions[client] = _Session(now_s)

    def dismiss(self, client: int) -> None:
        self._sessions.pop(client, None)

    def touch(self, client: int, now_s: float) -> None:
        """Extends the session after input on the page."""
        if self.role(client, now_s) is Role.STAFF:
            self._sessions[client].used_s = now_s

    def role(self, client: int, now_s: float) -> Role:
        if self.expires_s(client, now_s) > 0.0:
            return Role.STAFF
        self._sessions.pop(client, None)
        return Role.RIDER

    def expires_s(self, client: int, now_s: float) -> float:
        """Seconds until the session ends without input on the page; 0 without one."""
        session = self._sessions.get(client)
        if session is None or now_s < session.used_s:  # time that ran backwards ends a session
            return 0.0
        idle_s = session.used_s + self._params.idle_s - now_s
        return max(0.0, min(idle_s, session.begun_s + self._params.session_s - now_s))
