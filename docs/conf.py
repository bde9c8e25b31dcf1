"""The users' site: ``make docs`` builds it into ``docs/_build/html``, without the network."""

import logging
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_extensions"), str(HERE.parent / "src")]

from gallery_files import copy_examples, files_scraper  # noqa: E402
from sphinx_gallery.sorting import ExplicitOrder  # noqa: E402

import isomatch  # noqa: E402

logging.getLogger("isomatch").setLevel(logging.WARNING)  # an example may load a package that logs everything

project = "isomatch"
author = "The isomatch authors"
copyright = author
version = release = isomatch.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "cyclopts.ext.sphinx",
    "mathml",
    "reference",
    "repository_links",
]
exclude_patterns = ["_build", "_extensions", "dev", "gallery/**/*.md5", "gallery/**/*.py"]
nitpicky = True
suppress_warnings = ["config.cache"]

default_role = "py:obj"
add_module_names = False
autosummary_generate = True
autodoc_typehints = "none"  # the docstrings give types with shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False  # the template of a class lists them
numpydoc_class_members_toctree = False

myst_enable_extensions = ["dollarmath", "colon_fence", "attrs_block"]
myst_heading_anchors = 4
html_math_renderer = "mathml"

templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme = "furo"
html_title = "isomatch"
html_show_sphinx = False
html_copy_source = False

html_extra_path = ["_build/extra"]

copy_examples()
sphinx_gallery_conf = {
    "examples_dirs": "_build/examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/(?!blender)\w+\.py$",  # one needs Blender
    "ignore_pattern": r"__init__",
    "subsection_order": ExplicitOrder(
        [f"_build/examples/{name}" for name in ("matching", "trust", "using", "distances")]
    ),
    "within_subsection_order": "in_order.InOrder",
    "image_scrapers": ("matplotlib", files_scraper),
    "reset_modules": (),
    "nested_sections": False,
    "download_all_examples": False,
    "capture_repr": (),
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
    "default_thumb_file": str(HERE / "images" / "demo.png"),
    "thumbnail_size": (480, 320),
}
