"""Signatures of digital calibration certificates: XAdES by a key of the laboratory, and what those of others show.

signxml is the extra `dcc`.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.extras import needed

_DS = "http://www.w3.org/2000/09/xmldsig#"
_XADES = "http://uri.etsi.org/01903/v1.3.2#"


@dataclass(frozen=True)
class Signed:
    """One signature in a certificate.

    Attributes:
        holds: whether the signed contents are unchanged, and are the whole certificate.
        by: subject of the signer's certificate; "" if it is not in the file.
        when: time of signing, as the signer's computer had it; "" if not given.
        trusted: whether the signer's certificate comes from a given authority; None if none was given.
        words: the state as a sentence.
    """

    holds: bool
    by: str
    when: str
    trusted: bool | None
    words: str


def signed(xml: bytes, key: Path, certificate: Path) -> bytes:
    """A certificate with a XAdES signature of all of its contents.

    Args:
        xml: the certificate without a signature.
        key: private key of the laboratory, PEM without a password, readable by its owner only.
        certificate: its X.509 certificate, PEM, with the chain behind it if there is one.

    Raises:
        UsageError: the extra `dcc` is not installed, or key and certificate cannot be used.
    """
    xades, etree = needed("signxml.xades", "dcc"), needed("lxml.etree", "dcc")
    try:
        own, chain = key.read_bytes(), certificate.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"key or certificate cannot be read: {error}") from error
    _must_fit(own, chain, key, certificate)
    signer = xades.XAdESSigner(signature_algorithm=_algorithm(own))
    try:
        done = signer.sign(_tree(etree, xml), key=own, cert=chain)
    except Exception as error:  # signxml raises those of three libraries
        raise UsageError(f"{key} cannot sign: {error}") from error
    told: bytes = etree.tostring(done, encoding="utf-8", xml_declaration=True)
    return told


def _must_fit(key: bytes, chain: str, key_file: Path, certificate: Path) -> None:
    """Raises `UsageError` if the key is none, has a password, or is not that of the certificate."""
    x509, loading = needed("cryptography.x509", "dcc"), needed("cryptography.hazmat.primitives.serialization", "dcc")
    try:
        private = loading.load_pem_private_key(key, password=None)
    except (ValueError, TypeError) as error:
        raise UsageError(f"{key_file} is not a private key in PEM without a password: {error}") from error
    try:
        public = x509.load_pem_x509_certificate(chain.encode()).public_key()
    except ValueError as error:
        raise UsageError(f"{certificate} is not an X.509 certificate in PEM: {error}") from error
    if private.public_key() != public:
        raise UsageError(f"{certificate} is the certificate of another key than {key_file}")


def _algorithm(key: bytes) -> str:
    """Algorithm of signatures by a key."""
    loading = needed("cryptography.hazmat.primitives.serialization", "dcc")
    name = type(loading.load_pem_private_key(key, password=None)).__name__
    return "rsa-sha256" if "RSA" in name else "ecdsa-sha256"


def _tree(etree: Any, xml: bytes) -> Any:
    parser = etree.XMLParser(no_network=True, resolve_entities=False, load_dtd=False, huge_tree=False)
    return etree.fromstring(xml, parser)


def signatures(xml: bytes, now: datetime, authority: Path | None = None) -> tuple[Signed, ...]:
    """Every signature of a certificate, verified.

    Args:
        xml: the certificate.
        now: present time, with its zone: whether the signer's certificate is still valid.
        authority: PEM with certificates of authorities that are trusted; None for none.

    Raises:
        UsageError: the extra `dcc` is not installed.
    """
    etree = needed("lxml.etree", "dcc")
    try:
        root = _tree(etree, xml)
    except etree.XMLSyntaxError as error:
        raise UsageError(f"this is not valid XML: {error}") from error
    return tuple(_verified(root, one, now, authority) for one in root.findall(f"{{{_DS}}}Signature"))


def _verified(root: Any, signature: Any, now: datetime, authority: Path | None) -> Signed:
    signxml, x509 = needed("signxml", "dcc"), needed("cryptography.x509", "dcc")
    embedded = signature.find(f".//{{{_DS}}}X509Certificate")
    when = signature.findtext(f".//{{{_XADES}}}SigningTime") or ""
    if embedded is None or not (embedded.text or "").strip():
        return Signed(False, "", when, None, "the signature has no certificate of its signer and cannot be verified")
    text = "".join(embedded.text.split())
    pem = f"-----BEGIN CERTIFICATE-----\n{text}\n-----END CERTIFICATE-----\n"
    try:
        own = x509.load_pem_x509_certificate(pem.encode())
        by = own.subject.rfc4514_string()
    except ValueError as error:
        return Signed(False, "", when, None, f"the certificate of the signer cannot be read: {error}")
    try:
        found = _references(signxml, root, signature, own)
    except Exception as error:  # whatever a broken signature makes libraries raise, it does not hold
        why = " ".join(str(error).split())[:200]
        return Signed(False, by, when, None, f"DOES NOT HOLD: {why or type(error).__name__}; signed by {by}")
    if not any(one.signed_xml is not None and one.signed_xml.tag == root.tag for one in found):
        return Signed(
            False, by, when, None, f"DOES NOT HOLD: it is not a signature of the whole certificate; signed by {by}"
        )
    trusted = None if authority is None else _trusted(signxml, root, signature, authority, own)
    known = {
        None: "the signer's certificate was not compared with an authority",
        True: "its certificate comes from the given authority",
        False: "its certificate does NOT come from the given authority",
    }[trusted]
    at = f", at {when} by the signer's clock" if when else ""
    until = own.not_valid_after_utc
    valid = f"is valid until {until:%Y-%m-%d}" if now <= until else f"was valid until {until:%Y-%m-%d}, and has expired"
    return Signed(True, by, when, trusted, f"holds: unchanged since it was signed by {by}{at}; {known}; it {valid}")


def _references(signxml: Any, root: Any, signature: Any, own: Any) -> list[Any]:
    """The signed parts, if the signature is that of this certificate's key. Raises signxml's and lxml's errors.

    The certificate may have expired since: it is taken at its first moment, and its end is told beside the result.
    """
    config = _expecting(signxml, signature, own.not_valid_before_utc)
    found = signxml.XMLVerifier().verify(_only(root, signature), x509_cert=own, expect_config=config)
    return found if isinstance(found, list) else [found]


def _expecting(signxml: Any, signature: Any, when: datetime) -> Any:
    """Any number of references, as XAdES has one more than plain signatures."""
    count = len(signature.findall(f"{{{_DS}}}SignedInfo/{{{_DS}}}Reference"))
    return signxml.SignatureConfiguration(expect_references=count, verification_time=when)


def _only(root: Any, signature: Any) -> Any:
    """The certificate with this one of its signatures, which does not sign the others."""
    kept = list(root).index(signature)
    alone = copy.deepcopy(root)
    for n, one in reversed(list(enumerate(alone))):
        if one.tag == signature.tag and n != kept:
            alone.remove(one)
    return alone


def _trusted(signxml: Any, root: Any, signature: Any, authority: Path, own: Any) -> bool:
    """Whether the signer's certificate is in this file, or was issued by an authority in it."""
    try:
        listed = needed("cryptography.x509", "dcc").load_pem_x509_certificates(authority.read_bytes())
    except (OSError, ValueError) as error:
        raise UsageError(f"{authority} has no certificates in PEM: {error}") from error
    if own in listed:
        return True
    config = _expecting(signxml, signature, own.not_valid_before_utc)
    try:
        signxml.XMLVerifier().verify(_only(root, signature), ca_pem_file=str(authority), expect_config=config)
    except Exception:  # an authority that did not issue it
        return False
    return True
