"""The documentation site: Sphinx with MyST. `make docs` builds it into build/docs/site.

Pages of EXECUTED are run before anything is written: a command that fails, or one that says
something else than the page shows, ends the build (docs/execution.py).
"""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import execution  # noqa: E402  # beside this file

import hamel  # noqa: E402

project = "hamel"
author = "the authors of hamel"
copyright = author
release = version = hamel.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_click"]
# directives of MyST, and anchors that other pages name
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
# blocks of model files hold what no lexer knows, such as "…"
suppress_warnings = ["misc.highlighting_failure"]
nitpicky = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 80

html_theme = "furo"
html_title = "hamel"
html_copy_source = False
html_show_copyright = False
html_last_updated_fmt = None  # the same bytes every day
html_theme_options = {"source_directory": "docs/", "navigation_with_keys": True}
pygments_style = "friendly"
pygments_dark_style = "monokai"


def _executed(app: Sphinx) -> None:
    """Every page that can be run, in a folder of its own."""
    folder = Path(app.outdir).parent / "executed"
    for page in execution.EXECUTED:
        wrong = execution.failure(HERE / page, folder / page.replace("/", "-").removesuffix(".md"))
        if wrong:
            raise ExtensionError(f"docs/{page}: {wrong}")


def setup(app: Sphinx) -> None:
    """Sphinx calls this once."""
    app.connect("builder-inited", _executed)
