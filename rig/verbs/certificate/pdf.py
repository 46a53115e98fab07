"""A certificate on paper, by typst: PDF/A, whose bytes follow from the document alone.

typst is the extra `certificate`. Only the fonts inside its package are used, and nothing is fetched.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime, time
from pathlib import Path

from rig.errors import ConfigurationError
from rig.extras import needed
from rig.verbs.certificate.document import Document
from rig.verbs.certificate.layout import contents

_TEMPLATE = Path(__file__).parent / "templates" / "certificate.typ"
_FONTS = (
    "typst's own fonts have Latin, Greek and Cyrillic; put a font that has it into a folder, and name the folder: "
    'fonts = "FOLDER" in certificate.toml'
)
_PACKAGE = re.compile(r"""["']@[A-Za-z]""")
_FETCHES = "imports a package, which would be fetched: copy what it needs"
_NOWHERE = "http://127.0.0.1:0"
"""A proxy that cannot be: no program can listen on port 0."""
_PROXIES = ("http_proxy", "https_proxy", "all_proxy")


def pdf(document: Document, template: Path | None = None, fonts: Path | None = None) -> bytes:
    """The certificate as PDF/A-2b.

    Args:
        document: the certificate.
        template: a laboratory's own template in typst, which reads `contents.json` beside it; None for ours.
        fonts: folder with fonts for texts that typst's own do not have; None for none.

    Raises:
        UsageError: the extra `certificate` is not installed.
        ConfigurationError: the template cannot be read, fetches a package, or has an error; or a text has no font.
    """
    typst = needed("typst", "certificate")
    source = _text(template or _TEMPLATE)
    with tempfile.TemporaryDirectory(prefix="rig-certificate-") as name:
        folder = Path(name)
        (folder / "main.typ").write_text(source, encoding="utf-8")
        told = json.dumps(contents(document), ensure_ascii=False)
        (folder / "contents.json").write_text(told, encoding="utf-8")
        if (logo := document.laboratory.logo) is not None:
            (folder / f"logo.{logo.kind}").write_bytes(logo.data)
        issued = datetime.combine(document.dates.issued, time(), UTC)
        more = [fonts] if fonts is not None else []
        none = folder / "contents.json" / "none"  # below a file there is no folder: no package is found or stored
        compiler = typst.Compiler(
            folder / "main.typ",
            root=folder,
            ignore_system_fonts=True,
            font_paths=more,
            package_path=none,
            package_cache_path=none,
        )
        try:
            with _without_network():
                made: bytes = compiler.compile(format="pdf", pdf_standards="a-2b", timestamp=int(issued.timestamp()))
        except typst.TypstError as error:
            if error.message.startswith(("failed to download package", "package not found")):
                raise ConfigurationError(f"template {template} {_FETCHES}") from error
            if "could not be displayed with font" in error.message:
                raise ConfigurationError(f"{error.message}: {_FONTS}") from error
            hints = "".join(f"; {hint}" for hint in error.hints)
            where = template or "the certificate"
            raise ConfigurationError(f"{where} cannot be set as a page: {error.message}{hints}") from error
    return made


@contextlib.contextmanager
def _without_network() -> Iterator[None]:
    """Let typst reach nothing: it fetches a package whose name is computed, which no search of the text finds.

    typst has no switch for that. It asks by the proxy of the environment alone, so this is one that cannot be.
    """
    kept = {name: value for name, value in os.environ.items() if name.lower() in (*_PROXIES, "no_proxy")}
    try:
        for name in kept:
            del os.environ[name]
        for name in _PROXIES:
            os.environ[name] = os.environ[name.upper()] = _NOWHERE
        yield
    finally:
        for name in _PROXIES:
            os.environ.pop(name, None)
            os.environ.pop(name.upper(), None)
        os.environ.update(kept)


def _text(template: Path) -> str:
    """Source of a template. Raises `ConfigurationError`."""
    try:
        source = template.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"template {template} cannot be read: {error}") from error
    if _PACKAGE.search(source):
        raise ConfigurationError(f"template {template} {_FETCHES}")
    return source
