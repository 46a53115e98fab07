"""How Sphinx makes the site of these documents: `make docs`."""

from __future__ import annotations

import re
import runpy
import tomllib
from functools import cache
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from rig.explain import explained

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


GENERATED = re.compile(r"<!-- rig explain ([\w -]+) -->\n")
LINK = re.compile(r"\[([^\]]*)\]\(([^)#:\s]+)(?:#[^)]*)?\)")


def prepared(app: Sphinx, document: str, text: list[str]) -> None:
    """Generated references; a link to a file that is no page of the site becomes the name of the file in the
    repository.
    """
    folder = (DOCS / document).parent

    def named(link: re.Match[str]) -> str:
        target = (folder / link[2]).resolve()
        if DOCS in target.parents or not target.exists():
            return link[0]
        return f"{link[1]} in `{target.relative_to(DOCS.parent)}`"

    text[0] = GENERATED.sub(generated, LINK.sub(named, text[0])).replace("<!-- tools/floor_plan -->\n", rooms())


def generated(mark: re.Match[str]) -> str:
    """What `rig explain` prints, in place of a mark; without its heading if the mark names one part."""
    topic, _, name = mark[1].partition(" ")
    found = explained(topic, name)
    return re.sub(r"\A#.*\n+", "", found) if name else found


@cache
def rooms() -> str:
    """The table of the floor plan."""
    plan = runpy.run_path(str(DOCS.parent / "tools" / "floor_plan"))
    known = plan["rooms"]()
    return str(plan["table"](plan["arrows"](known), known))


def setup(app: Sphinx) -> None:
    """What Sphinx calls."""
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", prepared)
