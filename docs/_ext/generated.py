# SPDX-License-Identifier: BSD-3-Clause
"""Parts of pages that are made from the program and from a report.

A mark `*Generated: NAME WORDS*` of a page is replaced by Markdown that the function of that name in
`listed`, `measured`, `shown` or `tested` returns, before the page is read, so that nothing on the
pages is copied by hand. A plain viewer shows the marks; `.venv/bin/python -m sphinx -W --keep-going
docs airlight-docs` builds the pages. Links to Python files of the project, which have no pages,
become the names of the files. A notebook is read as the Markdown of its cells and of what they
printed and showed.
"""

import json
import re
from pathlib import Path

import listed
import measured
import shown
import tested
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

ROOT = Path(__file__).resolve().parents[2]
_MARK = re.compile(r"\*Generated: ([a-z-]+)((?: [\w-]+)*)\*")
_SOURCE = re.compile(
    r"\[([^\]]+)\]\(\.\./((?:analytic|realtime|reference|validation|reports)/[\w/]+)\.py\)"
)
#: Documents in the folder above, and the pages that show them.
_PAGES = {"../DESIGN.md": "conventions.md"}


def fill(text: str) -> str:
    """Return the source of a page with its generated parts in place."""
    return _MARK.sub(_part, text)


def _part(match: re.Match[str]) -> str:
    # Only functions that the module defines count: an imported one of the same name is no part.
    name = match[1].replace("-", "_")
    for module in (listed, measured, shown, tested):
        function = getattr(module, name, None)
        if function is not None and function.__module__ == module.__name__:
            return function(*match[2].split())
    raise ExtensionError(f"{match[0]}: no module of docs/_ext has a function {name}")


def _code(link: re.Match[str]) -> str:
    return f"`{link[1].strip('`')}`"


def _notebook(text: str) -> str:
    """Return the cells of a notebook with their output as Markdown."""
    parts = []
    # Sources as code, outputs as HTML where they have it, as a notebook shows them.
    for cell in json.loads(text)["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "text/html" in data:
                parts.append("```{raw} html\n" + "".join(data["text/html"]) + "\n```")
            else:
                parts.append(
                    "```text\n"
                    + "".join(output.get("text") or data["text/plain"]).rstrip()
                    + "\n```"
                )
    return "\n\n".join(parts) + "\n"


def _replace(app: Sphinx, docname: str, content: list[str]) -> None:
    # First a notebook becomes Markdown; links are changed before the parts are filled in, which
    # have links of their own.
    if app.env.doc2path(docname).suffix == ".ipynb":
        content[0] = _notebook(content[0])
    text = _SOURCE.sub(_code, content[0])
    for path, page in _PAGES.items():
        text = text.replace(f"]({path}", f"]({page}")
    content[0] = fill(text)


def _escape(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Keep the underscore at the end of a parameter's name, which
    reStructuredText would take for a link.
    """
    lines[:] = [re.sub(r"^:param (\w+)_:", r":param \1\\_:", line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill every page when it is read."""
    # Made once here, before Sphinx starts processes that would each make it.
    listed.commands()
    app.connect("source-read", _replace)
    app.connect("autodoc-process-docstring", _escape, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
