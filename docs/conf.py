"""Settings of the documentation site: `make docs` writes it to docs/_build, and fetches nothing."""

import re
import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "Laufruhe"
author = "Laufruhe developers"
version = release = version_of("laufruhe")

extensions = [
    "labels",
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
    # index.rst includes it
    "README.md",
]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "amsmath"]
myst_heading_anchors = 3

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
    "image_scrapers": ("drawn",),
}

html_math_renderer = "mathml"
html_theme = "furo"
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
# a guide for programs that write problem files
html_extra_path = ["llms.txt"]
html_title = "Laufruhe"
html_theme_options = {"navigation_with_keys": True}


def add_accessible_markup(app, page, template, context, doctree):
    """Give headings of the navigation their level, and let keys reach blocks that scroll."""
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')
    body = context.get("body", "").replace("<pre>", '<pre tabindex="0">')
    context["body"] = body.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')


HERE = Path(__file__).parent
MEASURED = HERE / "measured"
LOGS = ("attack", "changes", "faults", "mutants", "proofs")
"""Folders of results whose README.md is a page of measurements too."""


def write_measured_pages(app, config):
    """Write a page for each page of measurements, which stand beside docs/ in the repository."""
    MEASURED.mkdir(exist_ok=True)
    results = HERE.parent / "results"
    logs = {f"{name}.md": results / name / "README.md" for name in LOGS}
    pages = {path.name: path for path in sorted((results / "benchmarks").glob("*.md"))} | logs
    for name, path in pages.items():
        options = ":relative-images:\n:relative-docs: ../../docs/"
        place = path.relative_to(HERE.parent).as_posix()
        text = f"```{{include}} ../../{place}\n{options}\n```\n"
        (MEASURED / name).write_text(text, encoding="utf-8")


def lead_within_the_site(app, *given):
    """Turn links to files beside docs/, and to the list of examples, into links to pages of the site."""
    content = given[-1]
    text = content[0].replace("gallery.md)", "gallery/index.rst)").replace("../CHANGELOG.md)", "changes.md)")
    text = re.sub(r"\[([^\]]+)\]\((?:results/README|SECURITY)\.md\)", r"\1", text)
    text = re.sub(rf"\]\((?:\.\./)*results/({'|'.join(LOGS)})/README\.md", r"](/measured/\1.md", text)
    content[0] = re.sub(r"\]\((?:\.\./)+results/benchmarks/([\w-]+\.md)", r"](/measured/\1", text)


def setup(app):
    """Connect the functions of this file to the events of the build."""
    app.connect("config-inited", write_measured_pages)
    app.connect("source-read", lead_within_the_site)
    app.connect("include-read", lead_within_the_site)
    # the theme makes its navigation at priority 500
    app.connect("html-page-context", add_accessible_markup, priority=900)
