"""Sphinx's configuration of the book; `build.py` lays out what it reads."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from fullam.version import __version__
from fullam.viz.style import BLUE, SKY

project = "fullam"
author = "The fullam developers"
copyright = "The fullam developers"
release = version = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "fullam_book.docstrings",
    "fullam_book.math_svg",
]
root_doc = "index"
smartquotes = False  # two hyphens are an option's
highlight_language = "text"  # of formulas in docstrings; everything else names its own
exclude_patterns = ["**.ipynb_checkpoints"]

# Pages.
myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_block"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # `fullam_book.executed` has done it
nb_merge_streams = True
nb_ipywidgets_js = {}  # which would come from elsewhere; `fullam_book.cells` shows stills
html_math_renderer = "svg"

# API: signatures as written, members in the order of the file.
autodoc_default_options = {"members": True, "show-inheritance": True, "no-value": True}
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"Array": "Array", "ArrayLike": "ArrayLike", "NDArray": "NDArray"}
autodoc_class_signature = "mixed"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
napoleon_attr_annotations = False
add_module_names = False
nitpick_ignore_regex = [  # type variables and private bases, of which autodoc makes no entry
    (
        "py:.*",
        r"fullam\..*\.(Item|Result|Rest|T|Thing|Function|Array|EstimatorType|ControllerType|Nominal"
        r"|Contact|_\w+)",
    )
]
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"


# Looks: the theme's, with the blue of the figures as its one accent.
def accent(colour: str) -> dict[str, str]:
    """The theme's variables that have a colour of their own."""
    places = ("brand-primary", "brand-content", "brand-visited", "api-name")
    return {f"color-{place}": colour for place in places} | {
        "color-api-pre-name": "var(--color-foreground-muted)"
    }


html_theme = "furo"
html_title = "fullam"
html_static_path = [str(HERE / "static")]
html_css_files = ["book.css"]
html_js_files = ["book.js"]
html_show_sphinx = False
html_show_search_summary = False  # fetches pages, which files opened from disk may not
html_copy_source = False
pygments_style = "friendly"
pygments_dark_style = "github-dark"
html_theme_options = {
    "light_css_variables": accent(BLUE),
    "dark_css_variables": accent(SKY),
    "navigation_with_keys": True,
}


def setup(app: Sphinx) -> None:
    """A CSV file needs no colours, and Pygments has none for it."""
    app.add_lexer("csv", TextLexer)
