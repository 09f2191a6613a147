"""The web server: files, one WebSocket a page, in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import uvicorn
from h11 import LocalProtocolError
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from robot_stack.core.config import ConfigError
from robot_stack.ui.nodes.connections import Connections
from robot_stack.ui.origin import Gate
from robot_stack.ui.params import ServerParams
from robot_stack.ui.protocol import STAFF_BYTES_MAX

WEB = Path(__file__).resolve().parents[1] / "web"
COOKIE = "touch_ui"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".woff2": "font/woff2",
}
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_POLICY_VIOLATION, _TOO_MANY = 1008, 1013
_CONNECTIONS_MAX = 64
_START_S, _JOIN_S = 10.0, 5.0


class PageHub(Protocol):
    """What a server's pages talk to; called in the server's loop. page: whatever ``join`` returned."""

    def full(self) -> bool: ...
    def join(self, address: str) -> Any: ...
    def leave(self, page: Any) -> None: ...
    def on_message(self, page: Any, text: str | bytes | None) -> bool: ...
    async def send(self, page: Any, text: Callable[[str], Any], data: Callable[[bytes], Any]) -> None: ...


class WebServer:
    """extra: path -> (type, bytes) beside the files of ``web/``, or instead of them.

    cookie: its name; a browser sends a host's cookies to all its ports. Raises ConfigError if the address cannot be
    used or the certificate cannot be read.
    """

    def __init__(
        self, params: ServerParams, hub: PageHub, extra: Mapping[str, tuple[str, bytes]], cookie: str = COOKIE
    ) -> None:
        self._socket = _bind(params)
        self.port = int(self._socket.getsockname()[1])
        self._params, self.hub, self._extra, self._cookie = params, hub, extra, cookie
        self._gate = Gate(params, self.port)
        # The only valid paths: a request's path is looked up here, never on the disk.
        self._files = {f"/{path.relative_to(WEB).as_posix()}": path for path in WEB.rglob("*") if path.suffix in TYPES}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._started = threading.Event()
        self._server = uvicorn.Server(self._configuration())
        self._connections = Connections(params.request_s, lambda: self._server.server_state.connections)
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)
        self._thread.start()
        self._started.wait(_START_S)

    @property
    def url(self) -> str:
        host = f"[{self._params.address}]" if ":" in self._params.address else self._params.address
        return f"{'https' if self._params.tls_certificate else 'http'}://{host}:{self.port}/"

    def alive(self) -> bool:
        return self._thread.is_alive()

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Calls a function of the hub in the server's thread; may be called from any thread."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the server has just ended
                self._loop.call_soon_threadsafe(function, *arguments)

    def close(self) -> None:
        self._server.should_exit = self._server.force_exit = True  # pages lose their link; no waiting
        self._thread.join(_JOIN_S)
        self._socket.close()

    # --- the server's thread -----------------------------------------------------------------------------------------

    def _configuration(self) -> uvicorn.Config:
        routes = [WebSocketRoute("/ws", self._page), Route("/{path:path}", self._file, methods=["GET"])]
        configuration = uvicorn.Config(
            _ends_quietly(Starlette(routes=routes)),
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="websockets-sansio",
            ws_max_size=STAFF_BYTES_MAX,
            ws_per_message_deflate=False,
            limit_concurrency=_CONNECTIONS_MAX,
            timeout_keep_alive=5,
            timeout_graceful_shutdown=1,
            server_header=False,
            proxy_headers=False,
            ssl_certfile=self._params.tls_certificate or None,
            ssl_keyfile=self._params.tls_key or None,
        )
        try:
            configuration.load()
        except OSError as error:
            self._socket.close()
            raise ConfigError(f"touch_ui: tls_certificate or tls_key cannot be used: {error}") from error
        return configuration

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._started.set()
        watch = asyncio.create_task(self._connections.watch())
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            watch.cancel()

    # --- requests ----------------------------------------------------------------------------------------------------

    async def _file(self, request: Request) -> Response:
        if not self._gate.host(request.headers.get("host")):
            return Response("unknown host", 421, headers=_HEADERS)
        path = request.scope["path"]
        if self._gate.needs_token:
            given = request.query_params.get("token")
            if path == "/" and given is not None and self._gate.token(given):
                return self._welcome(given)
            if not self._gate.token(request.cookies.get(self._cookie)):
                return Response("token needed", 403, headers=_HEADERS)
        return self._found("/index.html" if path == "/" else path)

    def _found(self, path: str) -> Response:
        kind, data = self._extra.get(path, ("", b""))
        file = self._files.get(path)
        if file is not None and not kind:
            kind, data = TYPES[file.suffix], file.read_bytes()
        if not kind:
            return Response("not found", 404, headers=_HEADERS)
        lasting = "max-age=604800" if path.startswith("/vendor/") else "no-cache"
        return Response(data, media_type=kind, headers={**_HEADERS, "Cache-Control": lasting})

    def _welcome(self, token: str) -> Response:
        """Moves the token from the address bar to a cookie, which the browser sends with each request."""
        response = RedirectResponse("/", 303, headers=_HEADERS)
        response.set_cookie(self._cookie, token, httponly=True, secure=True, samesite="strict", path="/")
        return response

    async def _page(self, websocket: WebSocket) -> None:
        headers = websocket.headers
        allowed = self._gate.origin(headers.get("origin"), headers.get("host"))
        if not allowed or not self._gate.token(websocket.cookies.get(self._cookie)):
            await websocket.close(_POLICY_VIOLATION)  # before it is accepted: 403
            return
        await websocket.accept()
        if self.hub.full():
            await websocket.close(_TOO_MANY)
            return
        address = (websocket.client.host, websocket.client.port) if websocket.client else ("?", 0)
        self._connections.pages.add(address)
        page = self.hub.join(address[0])
        sender = asyncio.create_task(self.hub.send(page, websocket.send_text, websocket.send_bytes))
        try:
            await self._listen(websocket, page)
        finally:
            self.hub.leave(page)
            self._connections.pages.discard(address)
            sender.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError, OSError):
                await sender

    async def _listen(self, websocket: WebSocket, page: Any) -> None:
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if not self.hub.on_message(page, message.get("text")):
                await websocket.close(_POLICY_VIOLATION)
                return


def _ends_quietly(app: ASGIApp) -> ASGIApp:
    """Suppresses the error after a broken body: the server itself has answered 400 already."""

    async def call(scope: Scope, receive: Receive, send: Send) -> None:
        async def answer(message: Message) -> None:
            with contextlib.suppress(LocalProtocolError):
                await send(message)

        await app(scope, receive, answer if scope["type"] == "http" else send)

    return call


def _bind(params: ServerParams) -> socket.socket:
    """The first free port. Raises ConfigError."""
    ports = range(params.port, min(params.port + params.ports, 65_536)) if params.port else (0,)
    problem: OSError | None = None
    for port in ports:
        listener = socket.socket(socket.AF_INET6 if ":" in params.address else socket.AF_INET, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((params.address, port))
            listener.listen(_CONNECTIONS_MAX)  # else a second process could bind the same port before uvicorn listens
            return listener
        except OSError as error:
            listener.close()
            problem = error
    where = f"{params.address} port {params.port}"
    raise ConfigError(f"touch_ui: {where} cannot be served: {problem.strerror if problem else ''}") from problem
