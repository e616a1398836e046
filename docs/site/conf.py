"""Configuration of the documentation site: Sphinx over the Markdown of the repository, as build.py lays it out."""

project = "Northing"
extensions = ["myst_nb", "sphinx.ext.mathjax", "autoapi.extension"]
html_theme = "furo"
html_title = "Northing"
html_static_path = ["_static"]
# Nothing is fetched when a page is read.
mathjax_path = "mathjax.js"
mathjax3_config = {"tex": {"tags": "ams"}}
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
# Notebooks are executed before, by the tests or by build.py.
nb_execution_mode = "off"
suppress_warnings = ["myst.header", "mystnb.unknown_mime_type", "misc.highlighting_failure", "toc.not_included", "autoapi.python_import_resolution"]
exclude_patterns = ["_autoapi_templates"]

# The module as its types say: no interpreter has to load it.
autoapi_dirs = ["module/northing"]
autoapi_file_patterns = ["*.pyi", "*.py"]
autoapi_root = "api/python"
autoapi_add_toctree_entry = False
autoapi_keep_files = False
autoapi_member_order = "bysource"
autoapi_options = ["members", "undoc-members", "imported-members", "show-inheritance"]
autoapi_python_class_content = "both"


def skip(app, what, name, obj, skip, options):
    """Private parts of the module are not documented where they are written but where they are public."""
    parts = name.split(".")
    return True if any(part.startswith("_") and not part.startswith("__") for part in parts[1:]) else skip


def setup(sphinx):
    """What Sphinx calls."""
    sphinx.connect("autoapi-skip-member", skip)
