# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as MathML, which browsers draw without scripts, fonts or a network."""

import re

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

_FUNCTION = "<mi>(?:arctan|cosh|cos|sinh|sin|tanh|tan|log|max)</mi>"
_SPACE = '<mspace width="0.1667em"/>'  # MathML knows no space about a function's name


def markup(latex: str, *, block: bool) -> str:
    """Return a formula as MathML.

    Parameters
    ----------
    latex
        The formula in LaTeX.
    block
        Whether it stands in a line of its own.

    Raises
    ------
    ExtensionError
        If the formula cannot be read.
    """
    from latex2mathml.converter import convert

    try:
        found = convert(latex, display="block" if block else "inline")
    except Exception as error:  # every slip in a formula has a class of its own
        raise ExtensionError(f"formula {latex!r}: {error or type(error).__name__}") from error
    if "\\" in found:  # an unknown command is handed on as a name
        raise ExtensionError(f"formula {latex!r}: unknown command, found in {found!r}")
    spaced = re.sub(rf"(?<=</mi>)(?={_FUNCTION})", _SPACE, found)
    return re.sub(rf"({_FUNCTION})(?=<mi>)", rf"\1{_SPACE}", spaced)


def _inline(writer, node: nodes.math) -> None:
    writer.body.append(markup(node.astext(), block=False))
    raise nodes.SkipNode


def _block(writer, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="formula">{markup(node.astext(), block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Give Sphinx the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
