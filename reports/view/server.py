# SPDX-License-Identifier: BSD-3-Clause
"""The page and its socket over HTTP: nothing is served to anyone who does not know
the token in the address.
"""

import http
import json
import secrets
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

_PAGE = Path(__file__).parent / "page"
_FILES = {
    "": ("view.html", "text/html; charset=utf-8"),
    "view.js": ("view.js", "text/javascript; charset=utf-8"),
    "view.css": ("view.css", "text/css; charset=utf-8"),
}
_HEADERS = (
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src "
        "data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
)


class Page:
    """One open page: what is sent to it."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection

    def tell(self, kind: str, **values: Any) -> None:
        """Send values as JSON; a page that was closed misses them."""
        self._send(json.dumps({"kind": kind} | values, allow_nan=False))

    def show(self, picture: bytes | memoryview, **values: Any) -> None:
        """Send a picture, 8-bit RGBA, with values as JSON before it."""
        # The length of the JSON, the JSON padded to four bytes, the picture: the page reads the
        # pixels in place.
        head = json.dumps(values, allow_nan=False).encode()
        head += b" " * (-len(head) % 4)
        self._send(b"".join((struct.pack("<I", len(head)), head, picture)))

    def close(self, why: str) -> None:
        """Say why and close."""
        self.tell("closed", message=why)
        self._connection.close()

    def _send(self, message: str | bytes) -> None:
        from websockets.exceptions import ConnectionClosed

        with suppress(ConnectionClosed, OSError):
            self._connection.send(message)


class Server:
    """The server of one view; port 0 is any free one.

    `opened`, `told`, `closed` are called in separate threads: with a page that was opened, with a
    page and what it says, with a closed page.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        opened: Callable[[Page], None],
        told: Callable[[Page, dict[str, Any]], None],
        closed: Callable[[Page], None],
    ) -> None:
        from websockets.sync.server import serve

        # A view runs code of the user: a program that reaches the port must know the token too.
        self._token = secrets.token_urlsafe(24)
        self._opened, self._told, self._closed = opened, told, closed
        self._server = serve(
            self._talk,
            host,
            port,
            process_request=self._answer,
            compression=None,
            max_size=2**16,
            server_header=None,
        )
        # Port 0 has become a real one.
        self.port = self._server.socket.getsockname()[1]
        shown = f"[{host}]" if ":" in host else host
        self.address = f"http://{shown}:{self.port}/{self._token}/"

    def start(self) -> None:
        """Serve from now on, in threads."""
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def stop(self) -> None:
        """Serve nothing any more."""
        self._server.shutdown()

    def _answer(self, connection, request):
        """Return the response to a request; None where it may open the socket."""
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        # The address is /TOKEN/FILE; the token is compared in constant time, and a wrong one is
        # answered like a missing file.
        token, slash, file = request.path.partition("?")[0].removeprefix("/").partition("/")
        known = secrets.compare_digest(token.encode(), self._token.encode()) and slash
        if known and file == "socket":
            # A page of another site must not open the socket, even if it has learnt the token.
            origin, host = request.headers.get("Origin"), request.headers.get("Host")
            if origin is not None and origin != f"http://{host}":
                return connection.respond(http.HTTPStatus.FORBIDDEN, "another origin\n")
            return None
        if not (known and file in _FILES):
            return connection.respond(http.HTTPStatus.NOT_FOUND, "not found\n")
        # Files by a fixed list: no path of a request reaches the file system.
        name, kind = _FILES[file]
        body = (_PAGE / name).read_bytes()
        shape = (
            ("Content-Type", kind),
            ("Content-Length", str(len(body))),
            ("Connection", "close"),
        )
        headers = Headers([*_HEADERS, *shape])
        return Response(200, "OK", headers, body)

    def _talk(self, connection) -> None:
        from websockets.exceptions import ConnectionClosed

        page = Page(connection)
        self._opened(page)
        try:
            # Anything that is no JSON object is ignored.
            for message in connection:
                said = _parsed(message)
                if said is not None:
                    self._told(page, said)
        except ConnectionClosed:
            pass
        finally:
            self._closed(page)


def _parsed(message: str | bytes) -> dict[str, Any] | None:
    try:
        said = json.loads(message)
    except ValueError:
        return None
    return said if isinstance(said, dict) else None
