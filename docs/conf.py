"""How Sphinx makes the site of these documents: `make docs`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

DOCS = Path(__file__).parent.resolve()
PROJECT = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = PROJECT["name"]
author = "The calibration-rig authors"
project_copyright = author
release = version = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 4
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
smartquotes = False  # options have two hyphens
default_role = "code"  # in docstrings
html_title = f"{project} {version}"
html_copy_source = html_show_sphinx = False
autodoc_typehints = "description"
napoleon_use_ivar = True


LINK = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(?:#[^)]*)?\)")


def outside(app: Sphinx, document: str, text: list[str]) -> None:
    """A link to a file that is no page of the site becomes the name of the file in the repository."""
    folder = (DOCS / document).parent

    def named(link: re.Match[str]) -> str:
        target = (folder / link[2]).resolve()
        if DOCS in target.parents or not target.exists():
            return link[0]
        return f"{link[1]} (`{target.relative_to(DOCS.parent)}`)"

    text[0] = LINK.sub(named, text[0])


def setup(app: Sphinx) -> None:
    """Diagrams are shown as their text: what would draw them is a script from a network."""
    for language in ("mermaid", "csv"):
        app.add_lexer(language, TextLexer)
    app.connect("source-read", outside)
