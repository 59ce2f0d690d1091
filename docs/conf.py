"""Settings of the documentation site: `make docs` writes it to docs/_build."""

from importlib.metadata import version as version_of

project = "Laufruhe"
author = "Laufruhe developers"
version = release = version_of("laufruhe")
extensions = ["myst_parser", "sphinx_copybutton"]
exclude_patterns = ["_build"]
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
# links to files beside docs/ are for readers of the repository
suppress_warnings = ["myst.xref_missing"]
html_theme = "furo"
html_title = "Laufruhe"
html_theme_options = {"navigation_with_keys": True}
