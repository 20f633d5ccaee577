# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx's settings. The pages are built by `.venv/bin/python -m sphinx -W
--keep-going docs airlight-docs`.
"""

import sys
from pathlib import Path

_HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(_HERE.parent / "src"), str(_HERE / "_ext")]

from airlight import __version__  # noqa: E402 - found on the path set above

project = "airlight"
author = "the airlight authors"
release = version = __version__

extensions = [
    "myst_parser",
    "mathml",
    "pages",
]
exclude_patterns = ["_ext", "data", "paper", "tools"]
source_suffix = {".md": "markdown", ".ipynb": "markdown"}
highlight_language = "none"  # what is indented is a formula
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
suppress_warnings = ["myst.header"]

html_theme = "furo"
html_title = f"airlight {__version__}"
html_static_path = ["_static"]
html_css_files = ["airlight.css"]
html_js_files = ["keyboard.js"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
