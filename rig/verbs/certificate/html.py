"""A certificate as one HTML file without references to others."""

from __future__ import annotations

from base64 import b64encode
from functools import cache

import jinja2

from rig.verbs.certificate.document import Document, Logo
from rig.verbs.certificate.layout import contents

_TYPES = {"svg": "image/svg+xml", "png": "image/png", "jpg": "image/jpeg"}


def html(document: Document) -> str:
    """The certificate as HTML; texts are escaped."""
    logo = document.laboratory.logo
    told = contents(document)
    return _template().render(**told, logo=None if logo is None else _inline(logo))


def _inline(logo: Logo) -> str:
    """A picture inside the page. As an image, a drawing cannot run scripts."""
    return f"data:{_TYPES[logo.kind]};base64,{b64encode(logo.data).decode()}"


def _css(text: str) -> str:
    """A text inside a quoted string of a style sheet."""
    return "".join(one if one.isalnum() or one in " -_.,/" else f"\\{ord(one):06x}" for one in text)


@cache
def _template() -> jinja2.Template:
    found = jinja2.Environment(
        loader=jinja2.PackageLoader("rig.verbs.certificate"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["css"] = _css
    return found.get_template("certificate.html.j2")
