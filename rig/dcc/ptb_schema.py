"""Checks of a digital calibration certificate by PTB's schema, which its user has; it is not part of this program.

lxml comes with the extra `dcc`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.extras import needed

_MOST = 20


def schema_errors(xml: bytes, schema: Path) -> list[str]:
    """Errors of a certificate by a schema, with their lines; [] if it is valid.

    Args:
        xml: the certificate.
        schema: file of the DCC schema. The schemas that it imports are searched beside it, by the names of their
            addresses or of their namespaces' usual files; nothing is fetched.

    Raises:
        UsageError: the extra `dcc` is not installed, or the schema cannot be used.
    """
    etree = needed("lxml.etree", "dcc")
    parser = etree.XMLParser(no_network=True, resolve_entities=False, load_dtd=False)
    parser.resolvers.add(_beside(etree, schema.parent))
    try:
        rules = etree.XMLSchema(etree.parse(str(schema), parser))
    except (OSError, etree.XMLSyntaxError, etree.XMLSchemaParseError) as error:
        raise UsageError(
            f"schema {schema} cannot be used: {error}. The schemas it imports must be beside it"
        ) from error
    plain = etree.XMLParser(no_network=True, resolve_entities=False, load_dtd=False)
    try:
        document = etree.fromstring(xml, plain)
    except etree.XMLSyntaxError as error:
        return [f"not valid XML: {error}"]
    rules.validate(document)
    return [f"line {one.line}: {one.message}" for one in list(rules.error_log)[:_MOST]]


_IMPORTED = {"SI_Format.xsd": ("dsi", "SI_Format"), "xmldsig-core-schema.xsd": ("ds_", "xmldsig")}
"""Names of imported schemas' files, and how names of copies begin."""


def _beside(etree: Any, folder: Path) -> Any:
    """Finds the imported schemas in the folder of the schema."""

    class InFolder(etree.Resolver):  # type: ignore[misc]
        def resolve(self, url: str, _: object, context: object) -> Any:
            name = url.rsplit("/", 1)[-1]
            starts = (name, *_IMPORTED.get(name, ()))
            found = sorted(one for one in folder.glob("*.xsd") if one.name.startswith(starts))
            return self.resolve_filename(str(found[0]), context) if found else None

    return InFolder()
