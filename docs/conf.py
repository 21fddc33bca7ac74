"""The site: `make docs` builds it from the pages that are there already, offline and without warnings, into docs/_build/html.

The source directory is the repository itself (this folder holds the configuration alone), so that README, cases and docs link to each
other on the site as they do in a clone.
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "extensions"))
sys.path.insert(0, str(ROOT))
os.environ["PYTHONPATH"] = str(ROOT)  # of the notebooks' kernels, which begin elsewhere

from fcsim.version import __version__  # noqa: E402

project, author, copyright = "fcsim", "The fcsim developers", "The fcsim developers"
version = release = __version__
root_doc = "docs/index"
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "plain_docstrings",
    "generated_pages",
    "redirect",
    "offline",
]
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/**", "cases/*/README.md", "tests/faults/README.md"]
exclude_patterns = [
    ".*", "**/.*", "build", "dist", "fcsim", "results", "tools", "benchmarks", "**/__pycache__", "docs/_build", "docs/extensions",
    "docs/gallery", "docs/_gallery/**/*.ipynb", "docs/_gallery/**/*.md5", "docs/_gallery/**/*.json",
]  # fmt: skip
source_suffix = {".rst": "restructuredtext", ".md": "myst-nb", ".ipynb": "myst-nb"}

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_timeout = 200
nb_execution_raise_on_error = True
nb_merge_streams = True
suppress_warnings = ["myst.header", "config.cache"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
add_module_names = False
toc_object_entries_show_parents = "hide"

sphinx_gallery_conf = {
    "examples_dirs": ["docs/gallery"],
    "gallery_dirs": ["docs/_gallery"],
    "filename_pattern": r"\.py$",
    "subsection_order": "gallery_pictures.by_section",
    "within_subsection_order": "gallery_pictures.by_difficulty",
    "image_scrapers": ("gallery_pictures.scrape", "matplotlib"),
    "reset_modules": ("matplotlib", "gallery_pictures.quiet_start"),
    "reset_modules_order": "before",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "min_reported_time": 1e9,
    "capture_repr": (),
    "write_computation_times": False,
    "show_signature": False,
    "plot_gallery": True,
}

html_show_search_summary = False  # a page that is opened as a file may not fetch the others, whose lines it would show
html_theme = "pydata_sphinx_theme"
html_title = f"fcsim {release}"
html_static_path = ["extensions/static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_sidebars = {
    f"docs/{page}": [] for page in ("index", "first_steps", "promises", "comparison", "_generated/solvers", "_generated/command_line")
}
html_context = {"default_mode": "auto"}
html_theme_options = {
    "logo": {"text": "fcsim"},
    "navbar_end": ["theme-switcher"],
    "show_toc_level": 2,
    "header_links_before_dropdown": 5,
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
