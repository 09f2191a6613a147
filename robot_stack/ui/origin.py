"""Hosts and origins that a request may name: a foreign web page must not reach the robot through its browser."""

from __future__ import annotations

import hmac

from robot_stack.ui.params import ServerParams


class Gate:
    """port: the one really served.

    A request's Host is checked as well as its Origin: otherwise a foreign name that resolves to this host would have
    the same origin as its own page.
    """

    def __init__(self, params: ServerParams, port: int) -> None:
        scheme = "https" if params.tls_certificate else "http"
        names = {"localhost", "127.0.0.1", "[::1]", *params.host_names}
        names.add(f"[{params.address}]" if ":" in params.address else params.address)
        self._hosts = {f"{name.lower()}:{port}" for name in names}
        if port == (443 if scheme == "https" else 80):
            self._hosts |= {name.lower() for name in names}
        self._origins = {f"{scheme}://{host}" for host in self._hosts}
        self._token = params.token.encode()

    def host(self, host: str | None) -> bool:
        return host is not None and host.lower() in self._hosts

    def origin(self, origin: str | None, host: str | None) -> bool:
        """For a WebSocket: True if the origin is ours and equals the page's own host."""
        if origin is None or not self.host(host):
            return False
        return origin.lower() in self._origins and origin.lower().partition("://")[2] == (host or "").lower()

    @property
    def needs_token(self) -> bool:
        return bool(self._token)

    def token(self, given: str | None) -> bool:
        """True without a token, or with the right one; takes the same time for every wrong one."""
        return not self._token or hmac.compare_digest((given or "").encode(), self._token)
