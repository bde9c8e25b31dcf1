"""Formulas as MathML, which browsers draw without a script, a font or the network."""

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml


def inline(writer, node):
    """Write a formula within a line."""
    writer.body.append(tex2mathml(node.astext()))
    raise SkipNode


def block(writer, node):
    """Write a formula on lines of its own."""
    writer.body.append(
        writer.starttag(node, "div", CLASS="math") + tex2mathml(node.astext(), as_block=True) + "</div>"
    )
    raise SkipNode


def setup(app):
    """Add the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
