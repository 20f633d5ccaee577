# SPDX-License-Identifier: BSD-3-Clause
"""The server of the view: nothing for who does not know the token, over
HTTP and over the socket.
"""

import errno
import json
import socket
import struct
import urllib.error
import urllib.request
from contextlib import suppress

import pytest

from airlight.reports.view.server import Server

websockets = pytest.importorskip("websockets.sync.client", reason="the extra `view` has it")


@pytest.fixture
def heard():
    return []


@pytest.fixture
def server(heard):
    def opened(page):
        page.tell("hello", number=3)
        page.show(b"\1\2\3\4", kind="frame", frame=1)

    serving = Server(
        "127.0.0.1",
        0,
        opened=opened,
        told=lambda page, said: heard.append(said),
        closed=lambda page: heard.append("closed"),
    )
    serving.start()
    yield serving
    serving.stop()


def fetched(address):
    """Status, headers and body; no proxy of this machine is asked."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(address, timeout=60) as response:
            return response.status, response.headers, response.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers, error.read()


def test_who_knows_the_token_gets_the_page(server):
    files = {
        "": ("text/html", b"<title>"),
        "view.js": ("text/javascript", b"WebSocket"),
        "view.css": ("text/css", b"#"),
    }
    for file, (kind, holds) in files.items():
        status, headers, body = fetched(server.address + file)
        assert status == 200
        assert headers["Content-Type"].startswith(kind)
        assert holds in body
        assert headers["Referrer-Policy"] == "no-referrer"
        assert "default-src 'none'" in headers["Content-Security-Policy"]


@pytest.mark.claim("view-token")
def test_who_does_not_gets_nothing(server):
    base, token = server.address.rstrip("/").rsplit("/", 1)
    wrong = (
        "/",
        "/view.js",
        "/socket",
        "//view.css",
        "/wrong/",
        "/%2e/{token}/",
        "/{short}/",
        "/{long}/view.js",
    )
    for path in (*wrong, "/{token}", "/{token}/server.py", "/{token}/../server.py"):
        status, _, body = fetched(
            base + path.format(token=token, short=token[:-1], long=token + "x")
        )
        assert (status, body) == (404, b"not found\n"), path


@pytest.mark.claim("view-token")
def test_the_socket_wants_the_token_too(server, heard):
    address = server.address.replace("http", "ws")
    for wrong in (address.rstrip("/")[:-1] + "/socket", address.rsplit("/", 2)[0] + "/socket"):
        with pytest.raises(websockets.InvalidStatus) as raised:
            websockets.connect(wrong, proxy=None)
        assert raised.value.response.status_code == 404
    # a page of another site that has learnt the token
    with pytest.raises(websockets.InvalidStatus) as raised:
        websockets.connect(address + "socket", proxy=None, origin="http://elsewhere.example")
    assert raised.value.response.status_code == 403
    assert heard == []
    own = server.address.rsplit("/", 2)[0]
    with websockets.connect(address + "socket", proxy=None, origin=own) as right:
        assert json.loads(right.recv(timeout=60)) == {"kind": "hello", "number": 3}
        message = right.recv(timeout=60)
        (size,) = struct.unpack_from("<I", message)
        assert size % 4 == 0
        assert json.loads(message[4 : 4 + size]) == {"kind": "frame", "frame": 1}
        assert message[4 + size :] == b"\1\2\3\4"
        for said in ("{", "[1]", '{"kind": "reset"}'):
            right.send(said)
    server.stop()
    assert heard == [{"kind": "reset"}, "closed"]


@pytest.mark.claim("view-this-machine")
def test_only_this_machine_is_served(server):
    port = server.port
    own = "127.0.0.2"  # this machine too, by another address
    with suppress(OSError):  # a bare machine does not know its own name
        named = socket.gethostbyname(socket.gethostname())
        own = own if named.startswith("127.") else named
    with socket.socket() as other:
        other.settimeout(5)
        assert other.connect_ex((own, port)) == errno.ECONNREFUSED
    with socket.socket() as other:
        assert other.connect_ex(("127.0.0.1", port)) == 0
