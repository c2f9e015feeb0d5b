"""Formulas as MathML, which browsers draw by themselves: the site needs no other site and no script."""

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml


def write_formula(self, node):
    """Write a formula; `self` is the writer of HTML."""
    block = isinstance(node, nodes.math_block)
    tag = "div" if block else "span"
    self.body.append(f'<{tag} class="formula">{tex2mathml(node.astext().strip(), as_block=block)}</{tag}>')
    raise nodes.SkipNode


def setup(app):
    """Register the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (write_formula, None), (write_formula, None))
    return {"parallel_read_safe": True}
