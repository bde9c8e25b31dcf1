"""The developers' site: ``make docs-dev`` builds it into ``docs/_build/dev``, without the network."""

import sys
from pathlib import Path

DOCS = Path(__file__).parents[1]
sys.path.insert(0, str(DOCS / "_extensions"))

project = "isomatch, for developers"
author = "The isomatch authors"
copyright = author

extensions = ["files_of_subpackages", "myst_parser", "house", "repository_links"]
nitpicky = True

myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_block"]
myst_heading_anchors = 4

html_static_path = ["../_static"]
html_css_files = ["site.css"]
html_theme = "furo"
html_title = project
html_show_sphinx = False
html_copy_source = False
