"""The documentation site: `make docs` builds it in build/docs/html.

Sources are Markdown files of the whole repository, so that a page has one home and links work in both places.
"""

import os
import shutil
import sys
from pathlib import Path

import latinpc

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
# what notebooks print; IPython writes into its folder
profile = HERE.parent / "build" / "docs" / "ipython"
shutil.rmtree(profile, ignore_errors=True)
shutil.copytree(HERE / "_ipython", profile)
os.environ["IPYTHONDIR"] = str(profile)
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])  # where latinpc is

project = "latinpc"
author = "the latinpc developers"
copyright = "the latinpc developers, BSD 2-clause licence"
version = release = latinpc.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "manual_pages",
    "mathml",
    "petsc_help",
]

# ---- pages: the sources are the root of the repository ----------------------------------------------

root_doc = "docs/index"
include_patterns = ["docs/**", "options/README.md", "benchmarks/*.md", "examples/classes/*.md", "CHANGELOG.md"]
exclude_patterns = ["**/.*", "docs/_*", "build", "demo"]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
highlight_language = "bash"  # of blocks that name none: commands
nitpicky = True
nitpick_ignore_regex = [
    ("c:identifier", ".*"),  # types of PETSc
    ("py:obj", ".*"),  # names in docstrings that exist and have no page
    ("py:.*", r"(petsc4py|mpi4py|numpy|np|pandas|matplotlib|pathlib|PETSc|MPI)(\..*)?"),
    ("py:class", r"ArrayLike|Communicator|Solver|Figure|enum\..*|Any|Mapping"),
]

# ---- notebooks run in each build --------------------------------------------------------------------

nb_execution_mode = "auto"
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

# ---- reference ----------------------------------------------------------------------------------------

default_role = "autolink"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

# ---- look ---------------------------------------------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_title = "latinpc"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["latinpc.css"]
html_extra_path = ["_static/root"]  # index.html of the whole site
html_show_sourcelink = False
html_sidebars = {"docs/install": [], "docs/developers": []}  # pages without others below
html_theme_options = {
    "logo": {"text": "latinpc"},
    "header_links_before_dropdown": 7,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": True,
    "navigation_depth": 3,
    "pygments_light_style": "friendly",
}
html_context = {"default_mode": "light"}
