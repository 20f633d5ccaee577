# SPDX-License-Identifier: BSD-3-Clause
"""Fills the parts of pages that the program makes: `.venv/bin/python docs/tools/fill_pages.py`.

A part of a page stands between two comments, which no viewer shows:

    <!-- part: NAME WORDS -->
    Markdown that the function of that name in `parts` returns
    <!-- end -->

so that nothing on the pages is copied by hand, and every page is whole in the repository. `--check`
writes nothing and ends with 1 where a page is stale; `.ci/lint` asks it.
"""

import argparse
import re
import sys
from pathlib import Path

from parts import api, challenge, engines, listed, measured, paper, shown, tested

ROOT = Path(__file__).resolve().parents[2]
_PART = re.compile(
    r"^<!-- part: ([a-z-]+)((?: [\w./-]+)*) -->\n.*?^<!-- end -->$", re.DOTALL | re.MULTILINE
)


def filled(text: str) -> str:
    """Return a page with its parts as they are now."""
    return _PART.sub(_part, text)


def _part(match: re.Match[str]) -> str:
    # Only functions that the module defines count: an imported one of the same name is no part.
    name = match[1].replace("-", "_")
    for module in (api, challenge, engines, listed, measured, paper, shown, tested):
        function = getattr(module, name, None)
        if function is not None and function.__module__ == module.__name__:
            head = match[0].partition("\n")[0]
            return f"{head}\n\n{function(*match[2].split()).strip()}\n\n<!-- end -->"
    sys.exit(f"{match[0]}: no module of docs/tools/parts has a function {name}")


def main() -> None:
    """Fill the pages, or say which are stale."""
    parser = argparse.ArgumentParser(description="Fill the parts of pages that the program makes.")
    parser.add_argument("--check", action="store_true", help="say which pages are stale")
    check = parser.parse_args().check
    paths = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    pages = {page: page.read_text("utf-8") for page in paths}
    stale = {page: new for page, old in pages.items() if (new := filled(old)) != old}
    for page, new in stale.items():
        name = page.relative_to(ROOT)
        if check:
            print(f"{name} is stale: type .venv/bin/python docs/tools/fill_pages.py")
        else:
            page.write_text(new, "utf-8")
            print(f"{name} is new")
    sys.exit(bool(check and stale))


if __name__ == "__main__":
    main()
