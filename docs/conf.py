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


DIAGRAM = re.compile(r"```mermaid\n.*?```\n", re.DOTALL)
UNDRAWN = "The diagram is drawn on the page's source in the repository; the tables say the same.\n"
"""What draws a diagram is a script from a network: the site does without."""
LINK = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(?:#[^)]*)?\)")


def prepared(app: Sphinx, document: str, text: list[str]) -> None:
    """A link to a file that is no page of the site becomes the name of the file in the repository; no diagrams."""
    folder = (DOCS / document).parent

    def named(link: re.Match[str]) -> str:
        target = (folder / link[2]).resolve()
        if DOCS in target.parents or not target.exists():
            return link[0]
        return f"{link[1]} in `{target.relative_to(DOCS.parent)}`"

    text[0] = DIAGRAM.sub(UNDRAWN, LINK.sub(named, text[0]))


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", prepared)
