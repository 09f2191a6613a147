"""Who may do what: riders by default, staff after the PIN, for a while. Times are steady seconds."""

from __future__ import annotations

from enum import StrEnum

from robot_stack.ui.params import AccessParams


class Role(StrEnum):
    RIDER = "rider"
    STAFF = "staff"


class PinTries:
    """One try at a time, and a wait after a row of wrong ones that doubles with each row.

    Of the screen as a whole: who opens a second page has no second row.
    """

    def __init__(self, tries: int, lock_s: float, lock_max_s: float) -> None:
        self._tries, self._lock_s, self._lock_max_s = tries, lock_s, lock_max_s
        self._wrong = 0
        self._rows = 0
        self._locked_until_s = float("-inf")
        self._trying = False

    def wait_s(self, now_s: float) -> float:
        """Seconds until a PIN is looked at again, 0: now."""
        return max(0.0, self._locked_until_s - now_s)

    def begin(self, now_s: float) -> bool:
        """False while locked, or while another try is looked at."""
        if self._trying or self.wait_s(now_s) > 0.0:
            return False
        self._trying = True
        return True

    def end(self, right: bool, now_s: float) -> None:
        self._trying = False
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
    """The staff sessions, one for each page that gave the PIN; a page that closes ends its own."""

    def __init__(self, params: AccessParams) -> None:
        self._params = params
        self._sessions: dict[int, _Session] = {}
        self.tries = PinTries(params.tries, params.lock_s, params.lock_max_s)

    @property
    def pin_set(self) -> bool:
        return bool(self._params.pin_hash)

    def admit(self, client: int, now_s: float) -> None:
        self._sessions[client] = _Session(now_s)

    def dismiss(self, client: int) -> None:
        self._sessions.pop(client, None)

    def touch(self, client: int, now_s: float) -> None:
        """Somebody does something on this page."""
        if self.role(client, now_s) is Role.STAFF:
            self._sessions[client].used_s = now_s

    def role(self, client: int, now_s: float) -> Role:
        if self.expires_s(client, now_s) > 0.0:
            return Role.STAFF
        self._sessions.pop(client, None)
        return Role.RIDER

    def expires_s(self, client: int, now_s: float) -> float:
        """Seconds until the session ends if nobody touches the page; 0 without one."""
        session = self._sessions.get(client)
        if session is None or now_s < session.used_s:  # time that ran backwards ends a session
            return 0.0
        idle_s = session.used_s + self._params.idle_s - now_s
        return max(0.0, min(idle_s, session.begun_s + self._params.session_s - now_s))
