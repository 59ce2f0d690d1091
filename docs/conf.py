"""Settings of the documentation site: `make docs` writes it to docs/_build, and fetches nothing."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "Laufruhe"
author = "Laufruhe developers"
version = release = version_of("laufruhe")
from drawn import scraper  # noqa: E402

extensions = [
    "mathml",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = [
    "_build",
    "jupyter_execute",
    "extensions",
    "examples",
    "gallery/*.ipynb",
    "gallery/*.py",
    "gallery/*.md5",
    # index.rst includes the one, and the site has the other with its pictures
    "README.md",
    "gallery.md",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "amsmath"]
myst_heading_anchors = 3
# links to files beside docs/ are for readers of the repository
suppress_warnings = ["myst.xref_missing", "config.cache"]

autodoc_typehints = "none"

# notebooks are run as the site is built; one that fails stops it
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120

# every example solves a ready problem, and its pictures are drawn as the site is built
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "only_warn_on_example_error": False,
    "show_memory": False,
    "min_reported_time": 1e9,
    "show_signature": False,
    "download_all_examples": False,
    "remove_config_comments": True,
    "within_subsection_order": "ExampleTitleSortKey",
    "image_scrapers": (scraper,),
}

html_math_renderer = "mathml"
html_theme = "furo"
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = "Laufruhe"
html_theme_options = {"navigation_with_keys": True}


def for_readers_aloud(app, page, template, context, doctree):
    """Headings of the navigation say their level; blocks that scroll can be reached by keys."""
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')
    body = context.get("body", "").replace("<pre>", '<pre tabindex="0">')
    context["body"] = body.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')


def with_pictures(app, *given):
    """Links to the list of examples lead to the gallery, which the site alone has."""
    content = given[-1]
    content[0] = content[0].replace("gallery.md)", "gallery/index.rst)")


def setup(app):
    """After the theme has made its navigation."""
    app.connect("source-read", with_pictures)
    app.connect("include-read", with_pictures)
    app.connect("html-page-context", for_readers_aloud, priority=900)
