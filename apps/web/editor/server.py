"""Serve the page and its four requests to one person at this machine.

The standard library's server is enough, and nothing has to be installed or kept up to date: one
person asks a few times a minute. It listens on 127.0.0.1 alone, on a port that the system chooses,
and takes no file's name from anybody.

    GET  /                 the page, without any data
    POST /api/open         a key, good for once, for the page's token
    GET  /api/state        what the page shows; waits for news
    GET  /api/sheet        the sheet's picture
    POST /api/corrections  everything that a person did so far

A key stands after the "#" of the address that the command prints: browsers do not send it along.
All but the first two need the token. Host and Origin must be this server's, so no other site's page
asks here, whatever name it is reached by.
"""

from __future__ import annotations

import hmac
import json
import secrets
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from toonset.apps.web.editor.scene import page_of
from toonset.apps.web.editor.session import Session, StaleError
from toonset.errors import SheetError, ToonsetError, one_line
from toonset.read import parse_json

HOST = "127.0.0.1"
TOKEN_HEADER = "X-Toonset-Token"
MOST_BYTES = 8 * 2**20  # of a body; more is refused before it is read
WAIT_S, SOCKET_S = 20.0, 30.0  # for news; for a client that does not go on
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class RefusedError(Exception):
    """A request that gets no answer but a status and why."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        """Say with which status, and why."""
        super().__init__(reason)
        self.status = status


class Server(ThreadingHTTPServer):
    """Serves one session."""

    daemon_threads = True

    def __init__(self, title: str) -> None:
        """Listen; requests are answered once `serve` runs."""
        super().__init__((HOST, 0), _Handler)
        self.page = page_of(None, None, title).encode("utf-8")
        self.token = secrets.token_urlsafe(32)
        self.key = secrets.token_urlsafe(24)
        self.lock = threading.Lock()
        self.session: Session | None = None
        self.tell_address: Callable[[str], None] = lambda address: None

    @property
    def origin(self) -> str:
        """Return the server's own origin."""
        return f"http://{HOST}:{self.server_port}"

    @property
    def address(self) -> str:
        """Return where a person opens the page, once."""
        return f"{self.origin}/#{self.key}"

    def opened(self, key: str) -> str | None:
        """Return the token for the key, which another one takes the place of; None for no key."""
        with self.lock:
            if not _same(key, self.key):
                return None
            self.key = secrets.token_urlsafe(24)
        self.tell_address(self.address)
        return self.token

    def serve(self, session: Session) -> threading.Thread:
        """Answer, in a thread that ends with `shutdown`."""
        self.session = session
        thread = threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        return thread

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore the error: a browser that went away is harmless."""


class _Handler(BaseHTTPRequestHandler):
    server_version, sys_version = "toonset", ""
    protocol_version = "HTTP/1.1"
    timeout = SOCKET_S

    @property
    def own(self) -> Server:
        """Return the server."""
        assert isinstance(self.server, Server)
        return self.server

    def do_GET(self) -> None:
        """Answer with the page, what it shows, or the sheet."""
        self._answer({"/": self._page, "/api/state": self._state, "/api/sheet": self._sheet})

    def do_POST(self) -> None:
        """Take a key, or corrections."""
        self._answer({"/api/open": self._open, "/api/corrections": self._corrections})

    def _answer(self, routes: dict[str, Callable[[], None]]) -> None:
        try:
            self._check_origin()
            route = routes.get(urlsplit(self.path).path)
            if route is None:
                raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such page")
            route()
        except RefusedError as error:
            self.close_connection = True  # a body that was not read would be the next request
            self._send(error.status, "application/json", _json({"error": str(error)}))
        except (ConnectionError, TimeoutError):
            raise
        except Exception as error:  # our bug: the page says so, and goes on
            self.close_connection = True
            reason = one_line(f"{type(error).__name__}: {error}")
            data = _json({"error": reason})
            self._send(HTTPStatus.INTERNAL_SERVER_ERROR, "application/json", data)

    def _check_origin(self) -> None:
        """Refuse what comes by way of another name, or from another site's page."""
        if self.headers.get_all("Host") != [self.own.origin.removeprefix("http://")]:
            raise RefusedError(HTTPStatus.MISDIRECTED_REQUEST, "this is another host")
        origins = self.headers.get_all("Origin") or []
        needed = self.command == "POST"
        if origins != [self.own.origin] and (needed or origins):
            raise RefusedError(HTTPStatus.FORBIDDEN, "this is another origin")
        if self.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none"):
            raise RefusedError(HTTPStatus.FORBIDDEN, "this is another site")

    def _session(self) -> Session:
        """Return the session, for those who have its token."""
        given = self.headers.get(TOKEN_HEADER, "")
        if not _same(given, self.own.token):
            raise RefusedError(HTTPStatus.UNAUTHORIZED, "the token is missing or another one")
        session = self.own.session
        if session is None or session.stopped:
            raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, "nothing is open")
        return session

    def _body(self) -> Any:
        length = self.headers.get("Content-Length", "")
        if self.headers.get("Transfer-Encoding") or not (length.isascii() and length.isdigit()):
            raise RefusedError(HTTPStatus.LENGTH_REQUIRED, "the length of the body is missing")
        if len(length) > 9 or int(length) > MOST_BYTES:
            raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "more than 8 MB")
        if self.headers.get_content_type() != "application/json":
            raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "JSON is needed")
        data = self.rfile.read(int(length))
        try:
            return parse_json(data, "body", SheetError)
        except ToonsetError as error:
            raise RefusedError(HTTPStatus.BAD_REQUEST, one_line(error)) from error

    def _page(self) -> None:
        self._send(HTTPStatus.OK, "text/html; charset=utf-8", self.own.page)

    def _open(self) -> None:
        body = self._body()
        key = body.get("key") if isinstance(body, dict) else None
        token = self.own.opened(key) if isinstance(key, str) else None
        if token is None:
            raise RefusedError(HTTPStatus.UNAUTHORIZED, "this address was used already")
        self._send(HTTPStatus.OK, "application/json", _json({"token": token}))

    def _state(self) -> None:
        session = self._session()
        asked = parse_qs(urlsplit(self.path).query)
        try:
            after, scene = (int(asked.get(name, ["-1"])[0][:9]) for name in ("after", "scene"))
        except ValueError as error:
            raise RefusedError(HTTPStatus.BAD_REQUEST, "after and scene are numbers") from error
        self._send(HTTPStatus.OK, "application/json", _json(session.state(after, scene, WAIT_S)))

    def _sheet(self) -> None:
        self._send(HTTPStatus.OK, "text/plain", self._session().picture.encode("ascii"))

    def _corrections(self) -> None:
        session, body = self._session(), self._body()
        if not isinstance(body, dict) or type(body.get("revision")) is not int:
            raise RefusedError(HTTPStatus.BAD_REQUEST, "corrections and their revision are needed")
        try:
            revision = session.save(body.get("corrections"), body["revision"])
        except StaleError:
            raise RefusedError(HTTPStatus.CONFLICT, "another tab was faster") from None
        except ToonsetError as error:
            raise RefusedError(HTTPStatus.UNPROCESSABLE_ENTITY, one_line(error)) from error
        self._send(HTTPStatus.OK, "application/json", _json({"revision": revision}))

    def _send(self, status: HTTPStatus, kind: str, data: bytes) -> None:
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the terminal is the command's."""


def _same(given: str, own: str) -> bool:
    """Compare in a time that does not tell how far they agree."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), own.encode())


def _json(values: dict[str, Any]) -> bytes:
    return json.dumps(values, allow_nan=False, separators=(",", ":")).encode()
