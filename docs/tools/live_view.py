# SPDX-License-Identifier: BSD-3-Clause
"""The picture of the live view in the documentation: `python docs/tools/live_view.py [FILE.png]`.

It starts `airlight view`, opens its page in Chromium by Playwright (the extra `test`), and
waits for the reference.
"""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_VIEW = ["view", "colonnade", "--method", "ray-march", "--set", "steps=12"]
_PATIENCE = 300_000  # for the reference [ms]; what is known then is shown


def take_picture(path: Path) -> None:
    """Write a picture of the page: the scene, a method beside its error, times and widgets."""
    from playwright.sync_api import TimeoutError, sync_playwright

    command = [sys.executable, "-m", "airlight", *_VIEW]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        with sync_playwright() as running:
            browser = running.chromium.launch(
                executable_path=shutil.which("chromium"), args=["--no-sandbox"]
            )
            page = browser.new_page(viewport={"width": 1060, "height": 740})
            page.goto(address)
            page.wait_for_selector("html[data-frame]")
            page.select_option("#beside", "error")
            page.locator("#wipe").fill("60")
            try:
                page.wait_for_selector("html[data-reference=done]", timeout=_PATIENCE)
                page.wait_for_selector("#other[data-known='1']")
            except TimeoutError:
                print("the reference is not whole: the machine has other work", file=sys.stderr)
            page.check("#run")  # to show how many frames a second has
            page.wait_for_timeout(6000)
            page.screenshot(path=path)
            browser.close()
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


if __name__ == "__main__":
    take_picture(
        Path(sys.argv[1]) if len(sys.argv) > 1 else _ROOT / "docs" / "data" / "live-view.png"
    )
