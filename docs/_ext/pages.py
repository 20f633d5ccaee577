# SPDX-License-Identifier: BSD-3-Clause
"""Pages of the site that differ from the files of the repository.

Links to Python files of the project, which have no pages, become the names of the files. A notebook
is read as the Markdown of its cells and of what they printed and showed. The first page has the
contents of the site, `contents.txt`.
"""

import json
import re
from pathlib import Path

from sphinx.application import Sphinx

_SOURCE = re.compile(
    r"\[([^\]]+)\]\(\.\./((?:analytic|realtime|reference|validation|reports)/[\w/]+)\.py\)"
)
_CONTENTS = Path(__file__).with_name("contents.txt")
#: Documents in the folder above, and the pages that show them.
_PAGES = {"../DESIGN.md": "conventions.md"}


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
    if app.env.doc2path(docname).suffix == ".ipynb":
        content[0] = _notebook(content[0])
    text = _SOURCE.sub(_code, content[0])
    for path, page in _PAGES.items():
        text = text.replace(f"]({path}", f"]({page}")
    contents = _CONTENTS.read_text(encoding="utf-8") if docname == "index" else ""
    content[0] = f"{text}\n{contents}"


def setup(app: Sphinx) -> dict[str, bool]:
    """Change the source of every page when it is read."""
    app.connect("source-read", _replace)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
