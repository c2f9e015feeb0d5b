"""The directive `manual-pages`: manual pages of public C functions and of solver types.

Its argument is a regular expression of names. Functions come in the order of `latinpc.h`, types before them.
"""

import re

from c_pages import markdown, public_functions, solver_types
from sphinx.util.docutils import SphinxDirective


class ManualPages(SphinxDirective):
    """List manual pages."""

    required_arguments = 1

    def run(self):
        """Return the pages."""
        functions, found = public_functions(), []
        for name, page in (solver_types() | functions).items():
            if page and re.fullmatch(self.arguments[0], name):
                found += self.parse_text_to_nodes(markdown(name, *page, functions))
        if not found:
            raise self.error(f"no public function or type is called {self.arguments[0]}")
        return found


def setup(app):
    """Register the directive."""
    app.add_directive("manual-pages", ManualPages)
    return {"parallel_read_safe": True}
