"""The page's server: who may ask, what is refused, and nothing else is reachable."""

import json
import socket
from collections.abc import Iterator
from http.client import HTTPConnection
from typing import Any, cast

import pytest

from toonset.apps.web.editor.server import MOST_BYTES, TOKEN_HEADER, Server
from toonset.apps.web.editor.session import Session, StaleError
from toonset.errors import SheetError


class Kept:
    """What a session keeps, without a bundle."""

    picture = "data:image/png;base64,"
    stopped = False

    def __init__(self) -> None:
        self.corrections: Any = {"version": 1}
        self.revision = 0

    def save(self, corrections: Any, revision: int) -> int:
        if revision != self.revision:
            raise StaleError
        if corrections == "broken":
            raise SheetError("corrections.json: is broken; correct it")
        self.corrections, self.revision = corrections, revision + 1
        return self.revision

    def state(self, after: int, scene: int, wait_s: float) -> dict[str, Any]:
        return {"revision": self.revision, "after": after, "scene": scene}


class Asker:
    """Asks as a browser with the page open would, unless told otherwise."""

    def __init__(self, server: Server, kept: Kept) -> None:
        self.server, self.kept = server, kept
        self.token = server.token

    def __call__(
        self,
        path: str,
        body: Any = None,
        *,
        method: str = "",
        raw: bytes | None = None,
        **headers: str | None,
    ) -> tuple[int, Any]:
        sent: dict[str, str | None] = {
            "Host": self.server.origin.removeprefix("http://"),
            TOKEN_HEADER: self.token,
        }
        data = raw if body is None else json.dumps(body).encode()
        if data is not None:
            sent |= {"Origin": self.server.origin, "Content-Type": "application/json"}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = HTTPConnection("127.0.0.1", self.server.server_port, timeout=10)
        kind = method or ("GET" if data is None else "POST")
        connection.putrequest(kind, path, skip_host=True)
        for name, value in sent.items():
            if value is not None:
                connection.putheader(name, value)
        if data is not None and "Content-Length" not in {name.title() for name in sent}:
            connection.putheader("Content-Length", str(len(data)))
        connection.endheaders(data)
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        is_json = answer.headers.get_content_type() == "application/json"
        return answer.status, json.loads(text) if is_json else text.decode()


@pytest.fixture
def ask() -> Iterator[Asker]:
    kept = Kept()
    with Server("A bundle") as server:
        thread = server.serve(cast(Session, kept))
        yield Asker(server, kept)
        server.shutdown()
        thread.join()


def saved(revision: int = 0) -> dict[str, Any]:
    return {"revision": revision, "corrections": {"version": 1, "boxes": []}}


def test_the_page_asks_and_keeps(ask: Asker) -> None:
    status, page = ask("/", X_Toonset_Token=None)
    assert status == 200
    assert "A bundle" in page
    assert ask.token not in page  # anybody at this machine may have the page, not what it shows
    assert ask.server.key not in page
    assert ask("/api/state?after=3&scene=4") == (200, {"revision": 0, "after": 3, "scene": 4})
    assert ask("/api/sheet")[0] == 200
    assert ask("/api/corrections", saved()) == (200, {"revision": 1})
    assert ask.kept.corrections == saved()["corrections"]


def test_it_listens_on_this_machine_alone(ask: Asker) -> None:
    assert ask.server.server_address[0] == "127.0.0.1"


@pytest.mark.parametrize("token", [None, "", "wrong", "x" * 43, "\u00e9"])
@pytest.mark.parametrize("path", ["/api/state", "/api/sheet", "/api/corrections"])
def test_a_missing_or_wrong_token_is_refused(ask: Asker, token: str | None, path: str) -> None:
    body = saved() if path == "/api/corrections" else None
    status, answer = ask(path, body, X_Toonset_Token=token)
    assert status == 401
    assert answer == {"error": "the token is missing or another one"}
    assert ask.kept.revision == 0


def test_a_key_is_good_for_once(ask: Asker) -> None:
    told: list[str] = []
    ask.server.tell_address = told.append
    key = ask.server.key
    assert ask("/api/open", {"key": "wrong"}, X_Toonset_Token=None)[0] == 401
    assert ask("/api/open", {"key": key}, X_Toonset_Token=None) == (200, {"token": ask.token})
    assert ask("/api/open", {"key": key}, X_Toonset_Token=None)[0] == 401
    assert told == [ask.server.address]  # for another tab
    assert ask("/api/open", {"key": ask.server.key})[0] == 200
    for nonsense in ({"key": 1}, {}, [], "key", {"key": "\ud800"}):
        assert ask("/api/open", nonsense)[0] in (400, 401)


@pytest.mark.parametrize("host", ["example.com", "localhost", "127.0.0.1", "127.0.0.1:1", "", None])
def test_another_host_is_refused(ask: Asker, host: str | None) -> None:
    for path, body in (("/", None), ("/api/state", None), ("/api/corrections", saved())):
        assert ask(path, body, Host=host)[0] in (400, 421)
    assert ask.kept.revision == 0


@pytest.mark.parametrize("origin", ["http://example.com", "null", "", "https://127.0.0.1", None])
def test_another_origin_is_refused(ask: Asker, origin: str | None) -> None:
    assert ask("/api/corrections", saved(), Origin=origin)[0] == 403
    assert ask("/api/open", {"key": ask.server.key}, Origin=origin)[0] == 403
    if origin is not None:
        assert ask("/api/state", Origin=origin)[0] == 403
    assert ask("/api/state", Sec_Fetch_Site="cross-site")[0] == 403
    assert ask.kept.revision == 0


@pytest.mark.parametrize(
    "path",
    [
        "/../../etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "/bundle/calibration.json",
        "/api/../corrections.json",
        "/api/state/../../x",
        "//etc/passwd",
        "/edit.html",
        "/api",
        "*",
    ],
)
def test_nothing_else_is_there(ask: Asker, path: str) -> None:
    assert ask(path)[0] in (400, 404)
    assert ask(path, saved())[0] in (400, 404)


def test_other_methods_are_not_known(ask: Asker) -> None:
    for method in ("PUT", "DELETE", "OPTIONS", "HEAD", "TRACE"):
        assert ask("/api/corrections", saved(), method=method)[0] == 501 or method == "HEAD"
    assert ask.kept.revision == 0


def test_a_large_body_is_refused_before_it_is_read(ask: Asker) -> None:
    hundred = str(100 * 10**6)
    assert ask("/api/corrections", raw=b"{", Content_Length=hundred)[0] == 413
    assert ask("/api/corrections", raw=b"{", Content_Length="9" * 40)[0] == 413
    assert ask("/api/corrections", raw=b"{", Content_Length="-1")[0] == 411
    assert ask("/api/corrections", raw=b"{", Content_Length="1e3")[0] == 411
    assert ask("/api/corrections", raw=b"0\r\n\r\n", Transfer_Encoding="chunked")[0] == 411
    assert ask("/api/corrections", raw=b" " * MOST_BYTES)[0] == 400  # it is read, and no JSON
    assert ask.kept.revision == 0


def test_what_is_no_correction_is_refused(ask: Asker) -> None:
    for body in ([], {}, {"revision": "0"}, {"revision": True}, "x"):
        assert ask("/api/corrections", body)[0] == 400
    assert ask("/api/corrections", raw=b"{")[0] == 400
    assert ask("/api/corrections", raw=b"[" * 100_000)[0] == 400
    assert ask("/api/corrections", saved(), Content_Type="text/plain")[0] == 415
    status, answer = ask("/api/corrections", {"revision": 0, "corrections": "broken"})
    assert (status, answer["error"]) == (422, "corrections.json: is broken; correct it")
    assert ask("/api/state?after=x")[0] == 400


def test_a_tab_that_is_behind_is_refused(ask: Asker) -> None:
    assert ask("/api/corrections", saved(0))[0] == 200
    assert ask("/api/corrections", saved(0))[0] == 409
    assert ask("/api/corrections", saved(1)) == (200, {"revision": 2})


def test_who_sends_half_a_request_holds_nobody_up(ask: Asker) -> None:
    with socket.create_connection(("127.0.0.1", ask.server.server_port)) as slow:
        slow.sendall(b"POST /api/corrections HTTP/1.1\r\nHost: x\r\nContent-Le")
        assert ask("/api/state")[0] == 200


def test_answers_are_for_this_page_alone(ask: Asker) -> None:
    connection = HTTPConnection("127.0.0.1", ask.server.server_port, timeout=10)
    connection.request("GET", "/")
    headers = connection.getresponse().headers
    connection.close()
    assert headers["Cache-Control"] == "no-store"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert headers["Access-Control-Allow-Origin"] is None
    assert "Python" not in headers["Server"]
