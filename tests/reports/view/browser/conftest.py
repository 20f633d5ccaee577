# SPDX-License-Identifier: BSD-3-Clause
"""The view of a small scene, as its command shows it, in a real browser."""

import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.helpers.browser import watched

ROOT = Path(__file__).resolve().parents[4]


@contextmanager
def running(*arguments):
    """The command, and the address that it prints."""
    command = [sys.executable, str(ROOT / "airlight.py"), "view", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert said.startswith("interrupted: ")
    assert len(said.splitlines()) == 1, said


def data(page, name):
    """What the page notes for tests."""
    return page.evaluate(f"document.documentElement.dataset.{name} ?? null")


def changed(page, do):
    """Do something, and wait until a new frame is there, the page was told where all stands, and nothing follows.

    What follows would be taken for the beginning of what is done next.
    """
    frame, told = (int(data(page, name)) for name in ("frame", "told"))
    do()
    page.wait_for_function(
        "([frame, told]) => +document.documentElement.dataset.frame > frame && "
        "+document.documentElement.dataset.told > told",
        arg=[frame, told],
    )
    settled(page)


def settled(page):
    """Wait until no frame and no word of where all stands has come for a while."""
    page.wait_for_function(
        """() => {
            const {frame, told} = document.documentElement.dataset, now = performance.now();
            const last = (window.settling ??= {});
            if (last.frame !== frame || last.told !== told) Object.assign(last, {frame, told, since: now});
            return now - last.since > 300;
        }"""
    )


@pytest.fixture(scope="module")
def address():
    with running("sphere-spot", "--size", "64x48") as (_, printed):
        yield printed


@pytest.fixture
def page(browser, address):
    """The page with its first frame; at the end nothing may have come from elsewhere, or been printed or thrown."""
    opened, told = watched(browser)
    opened.goto(address)
    opened.wait_for_selector("html[data-frame][data-told]")
    changed(opened, opened.locator("#reset").click)
    yield opened
    opened.close()
    asked = {word.removeprefix("request ") for word in told if word.startswith("request ")}
    assert [word for word in told if not word.startswith("request ")] == []
    assert {word for word in asked if not word.startswith("data:")} == {
        address + file for file in ("", "view.js", "view.css")
    }
