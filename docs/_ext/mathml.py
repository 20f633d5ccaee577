# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as MathML, which browsers draw without scripts, fonts or a
network, by docutils' converter.
"""

from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

_CHILDREN = {
    "mfrac": 2,
    "msub": 2,
    "msup": 2,
    "mover": 2,
    "munder": 2,
    "mroot": 2,
    "msubsup": 3,
    "munderover": 3,
}
_ROWS = ("math", "mrow", "mtd", "msqrt")
_APPLIED = "\u2061"  # docutils' mark between a function's name and what it is applied to
_WIDTH = "0.1667em"  # of the space around the name, which browsers leave out


def markup(latex: str, *, block: bool) -> str:
    """Return a formula in LaTeX as MathML, as a block or inline; one that
    cannot be read ends the build.
    """
    try:
        # The XML parser knows no HTML entities, and names without the namespace are shorter to
        # compare.
        formula = tex2mathml(latex, as_block=block).replace("&ApplyFunction;", _APPLIED)
    except Exception as error:  # a MathError, or an exception inside docutils
        raise ExtensionError(f"formula {latex!r}: {error}") from error
    root = ElementTree.fromstring(
        formula.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    )
    for element in root.iter():
        # docutils closes a brace that is left open: a fraction without denominator, an
        # index without anything in it.
        if len(element) != _CHILDREN.get(element.tag, len(element)) or (
            element.tag == "mrow" and not len(element)
        ):
            raise ExtensionError(f"formula {latex!r}: something is missing, is a brace left open?")
        if element.tag in _ROWS:
            element[:] = _spaced(list(element))
    return ElementTree.tostring(root, encoding="unicode")


def _spaced(row: list[ElementTree.Element]) -> list[ElementTree.Element]:
    """Return the children of a row with thin spaces about the names of
    functions, as TeX sets them.
    """
    spaced: list[ElementTree.Element] = []
    for element, following in zip(row, [*row[1:], None]):
        if element.text == _APPLIED:
            # No space before a bracket or another operator.
            if following is not None and following.tag != "mo":
                spaced.append(ElementTree.Element("mspace", width=_WIDTH))
            continue
        if (
            following is not None
            and following.text == _APPLIED
            and spaced
            and spaced[-1].tag not in ("mo", "mspace")
        ):
            spaced.append(ElementTree.Element("mspace", width=_WIDTH))
        spaced.append(element)
    return spaced


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
