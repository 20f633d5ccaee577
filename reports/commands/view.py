# SPDX-License-Identifier: BSD-3-Clause
"""`airlight view SCENE`: a live view of a scene in the browser."""

from typing import Annotated

import typer

from reports.commands import completion
from reports.commands.options import Changes, GivenKernels, Scene, Settings, single


def view(
    scene: Scene,
    method: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A method of `airlight list methods`, or your own as MODULE:FUNCTION or FILE.py:FUNCTION; "
            "shadow-planes by default.",
            show_default=False,
            autocompletion=completion.methods,
        ),
    ] = None,
    kernel: GivenKernels = None,
    settings: Settings = None,
    change: Changes = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height in pixels.")] = "640x480",
    host: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Where to listen; beyond 127.0.0.1, whoever knows the token may come in."),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port to listen at; 0 is any free one.")] = 0,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the browser, too.")] = False,
) -> None:
    """Show a scene live in the browser.

    The mouse moves the camera; widgets change method, kernel, parameters, lights and media. The page shows what a frame
    costs, stage by stage, and its error against the truth, which is computed while nothing moves. It also shows the
    command that renders the same frame. Ctrl-C ends the view.
    """
    from reports.view.server import check_library

    check_library()
    from reports.machine.environment import activate
    from validation.scenes.changes import parse_changes
    from validation.scenes.loading import parse_size
    from validation.study.configuration import configuration, parse_settings

    name = single("--method", method) or "shadow-planes"
    own_kernel, given = single("--kernel", kernel), parse_settings(settings or [])
    chosen = configuration(name, own_kernel, given)
    changes = parse_changes(change or [])
    pixels = parse_size(size)
    variant = activate()

    from reports.view.session import Session
    from reports.view.state import ViewState

    session = Session(ViewState(scene, pixels, chosen, changes), variant)
    try:
        server = _listening(session, host, port)
        print(f"{server.address}\nCtrl-C ends the view.", flush=True)
        if open_:
            import webbrowser

            webbrowser.open(server.address)
        session.run()
    finally:
        session.truth.end()


def _listening(session, host: str, port: int):
    """Return the server, started; refuse an address that cannot be listened at."""
    from analytic.errors import InputError
    from reports.view.server import Server

    try:
        server = Server(host, port, opened=session.opened, told=session.told, closed=session.closed)
    except OSError as error:
        raise InputError(
            f"--host, --port: cannot listen at {host}, port {port}: {error.strerror}; wanted an address of this "
            "machine, and a port that is free: 0 finds one"
        ) from error
    server.start()
    return server
