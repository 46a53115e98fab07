"""Seals of run files: a signature, or a time stamp by others, over the head hash and the certificates made from it.

A run file has no secret in it: everybody who can write it can recompute its chain. A seal is made by a key that a
forger does not have. `RUN.seal` beside the run file has all of its seals. cryptography and rfc3161-client are the extra
`seal`.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import new, sha256
from pathlib import Path
from typing import Any

from rig.errors import RunFileError, UsageError
from rig.extras import needed
from rig.files.atomic import write_whole
from rig.files.regular import open_regular
from rig.files.temporary import locked

_PURPOSE = b"calibration-rig seal 1\n"
"""Before every statement that is signed: the same key's signature of something else is no seal."""
_MOST = 16 << 20


@dataclass(frozen=True)
class Sealed:
    """A state of a run file, and files made from it, to be sealed.

    Attributes:
        run_id: of the run.
        records: number of its records.
        head: hash of the last of them.
        files: SHA-256 of certificates, by file name.
    """

    run_id: str
    records: int
    head: str
    files: Mapping[str, str]

    def statement(self, by: str, when: str) -> bytes:
        """The bytes that are signed, or stamped: every run of the program makes the same."""
        told = {"by": by, "files": dict(self.files), "head": self.head, "records": self.records, "run_id": self.run_id}
        return (
            _PURPOSE
            + json.dumps({**told, "when": when}, sort_keys=True, ensure_ascii=True, separators=(",", ":")).encode()
        )


@dataclass(frozen=True)
class Checked:
    """One seal of a run file, checked.

    Attributes:
        holds: whether it was made by its key, and is of this file.
        by: name that the sealer gave, which nothing proves.
        key: SHA-256 of the public key; "" for a time stamp.
        when: time of the seal; a time stamp's comes from its authority, any other from the sealer's clock.
        words: the state as a sentence.
    """

    holds: bool
    by: str
    key: str
    when: str
    words: str


def beside(run_file: Path) -> Path:
    """The file with the seals of a run file."""
    return run_file.with_suffix(".seal")


def hash_of(path: Path) -> str:
    """SHA-256 of a file. Raises `UsageError` if it cannot be read."""
    try:
        with open_regular(path) as file:
            digest = sha256()
            while part := file.read(1 << 20):
                digest.update(part)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from error
    return digest.hexdigest()


def seal(run_file: Path, what: Sealed, key: Path, by: str, when: datetime) -> dict[str, Any]:
    """Sign a state of a run file, and add the seal to `RUN.seal`.

    Args:
        run_file: the run file, which is not changed.
        what: its state and certificates.
        key: private Ed25519 key, PEM without a password.
        by: name of the sealer.
        when: time of the seal.

    Returns:
        The seal, as JSON values.

    Raises:
        UsageError: the extra `seal` is not installed, or the key cannot be used.
    """
    loading = needed("cryptography.hazmat.primitives.serialization", "seal")
    ed25519 = needed("cryptography.hazmat.primitives.asymmetric.ed25519", "seal")
    try:
        private = loading.load_pem_private_key(key.read_bytes(), password=None)
    except (OSError, ValueError, TypeError) as error:
        raise UsageError(f"{key} is not a private key in PEM without a password: {error}") from error
    if not isinstance(private, ed25519.Ed25519PrivateKey):
        raise UsageError(f"{key} is not an Ed25519 key: openssl genpkey -algorithm ed25519 -out KEY.pem makes one")
    at = when.astimezone(UTC).isoformat(timespec="seconds")
    public = private.public_key().public_bytes(loading.Encoding.Raw, loading.PublicFormat.Raw)
    made = {
        "by": by,
        "when": at,
        **_state(what),
        "public_key": b64encode(public).decode(),
        "signature": b64encode(private.sign(what.statement(by, at))).decode(),
    }
    _add(run_file, made)
    return made


def stamp(run_file: Path, what: Sealed, token: Path) -> dict[str, Any]:
    """Add the time stamp of an authority to `RUN.seal`.

    Args:
        run_file: the run file, which is not changed.
        what: its state and certificates, as they were when `statement_to_stamp` was written.
        token: response of the authority after RFC 3161, a file.

    Raises:
        UsageError: the extra `seal` is not installed, or the file is no time stamp of this statement.
    """
    response = _response(_read(token), str(token))
    if not _stamps(response, statement_to_stamp(what)):
        raise UsageError(
            f"{token} is the time stamp of something else: the run went on, or the certificates are others. "
            f"Ask for a stamp of what `rig seal RUN --statement FILE` writes now"
        )
    made = {
        "when": response.tst_info.gen_time.isoformat(),
        **_state(what),
        "time_stamp": b64encode(_read(token)).decode(),
    }
    _add(run_file, made)
    return made


def statement_to_stamp(what: Sealed) -> bytes:
    """The bytes whose time stamp is asked for: those of a seal, without a name or a time."""
    return what.statement("", "")


def _state(what: Sealed) -> dict[str, Any]:
    return {"run_id": what.run_id, "records": what.records, "head": what.head, "files": dict(what.files)}


def _read(path: Path) -> bytes:
    try:
        with open_regular(path) as file:
            return bytes(file.read(_MOST))
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from error


def _add(run_file: Path, made: Mapping[str, Any]) -> None:
    """Write `RUN.seal` anew with a further seal; those before it stay, also those that others add at this moment."""
    path = beside(run_file)
    with locked(path.resolve().parent):
        seals = [*stored(run_file), made]
        write_whole(path, lambda file: json.dump({"seals": seals}, file, indent=2))


def stored(run_file: Path) -> list[Any]:
    """The seals beside a run file, unchecked; [] without any. Raises `RunFileError` if the file is none of ours."""
    path = beside(run_file)
    if not path.exists():
        return []
    try:
        told = json.loads(_read(path))
        seals = told["seals"]
        if not isinstance(seals, list):
            raise TypeError
    except (ValueError, TypeError, KeyError, RecursionError):
        raise RunFileError(f"{path} is no file of seals: move it away, or bring back the one of this run") from None
    return seals


Holds = Callable[[int, bytes], bool]
"""Whether a run file has a record of this number and hash."""


def checked(
    run_file: Path, holds: Holds, authority: Path | None = None, keys: Sequence[Path] = ()
) -> tuple[Checked, ...]:
    """Every seal beside a run file, checked.

    Args:
        run_file: the run file.
        holds: called with number and hash of a record; whether the file has it.
        authority: PEM with certificates that time stamps may come from; None for none.
        keys: public keys, PEM, of which each seal's has to be one; () for any.

    Raises:
        UsageError: the extra `seal` is not installed, or a key cannot be read.
    """
    known = [_public(key) for key in keys]
    return tuple(_one(run_file, told, holds, authority, known) for told in stored(run_file))


def _public(path: Path) -> bytes:
    """The 32 bytes of a public Ed25519 key. Raises `UsageError`."""
    loading = needed("cryptography.hazmat.primitives.serialization", "seal")
    try:
        found: bytes = loading.load_pem_public_key(_read(path)).public_bytes(
            loading.Encoding.Raw, loading.PublicFormat.Raw
        )
    except ValueError as error:
        raise UsageError(f"{path} is not a public Ed25519 key in PEM: {error}") from error
    return found


def _one(run_file: Path, told: Any, holds: Holds, authority: Path | None, known: Sequence[bytes]) -> Checked:
    try:
        what = Sealed(str(told["run_id"]), int(told["records"]), str(told["head"]), _files(told["files"]))
        bytes.fromhex(what.head)
        stamped = "time_stamp" in told
        found = _stamp_checked(told, what, authority) if stamped else _signature_checked(told, what, known)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        return Checked(False, "", "", "", f"a seal cannot be read: {type(error).__name__} {error}")
    if not found.holds:
        return found
    if not holds(what.records, bytes.fromhex(what.head)):
        words = (
            f"DOES NOT HOLD: {found.words}, of another file: this has no record {what.records} of head {what.head[:16]}"
        )
        return Checked(False, found.by, found.key, found.when, words)
    of = "; ".join([f"records 1 to {what.records} are unchanged since", *_certificates(run_file, what)])
    return Checked(found.holds, found.by, found.key, found.when, f"{found.words}: {of}")


def _files(told: Any) -> dict[str, str]:
    return {str(name): str(digest) for name, digest in told.items()}


def _certificates(run_file: Path, what: Sealed) -> Iterator[str]:
    for name, digest in what.files.items():
        path = run_file.parent / Path(name).name
        if not path.is_file():
            yield f"certificate {name} is sealed too and not beside the run file, SHA-256 {digest}"
        elif hash_of(path) == digest:
            yield f"certificate {name} is unchanged since"
        else:
            yield f"certificate {name} is NOT the sealed one, whose SHA-256 is {digest}"


def _signature_checked(told: Any, what: Sealed, known: Sequence[bytes]) -> Checked:
    ed25519 = needed("cryptography.hazmat.primitives.asymmetric.ed25519", "seal")
    invalid = needed("cryptography.exceptions", "seal").InvalidSignature
    by, when = str(told["by"]), str(told["when"])
    public = b64decode(str(told["public_key"]), validate=True)
    key = sha256(public).hexdigest()
    about = f"sealed by {by or 'somebody'} at {when} by the sealer's clock, with key {key[:16]}"
    try:
        signature = b64decode(str(told["signature"]), validate=True)
        ed25519.Ed25519PublicKey.from_public_bytes(public).verify(signature, what.statement(by, when))
    except invalid:
        return Checked(False, by, key, when, f"DOES NOT HOLD: {about}: the seal was changed, or made without that key")
    if known and public not in known:
        return Checked(False, by, key, when, f"DOES NOT HOLD: {about}, which is none of the given keys")
    trust = "" if known else " (no public key was given to compare it with)"
    return Checked(True, by, key, when, about + trust)


def _response(data: bytes, name: str) -> Any:
    """A response of a time-stamp authority. Raises `UsageError`."""
    client = needed("rfc3161_client", "seal")
    try:
        return client.decode_timestamp_response(data)
    except ValueError as error:
        raise UsageError(f"{name} is no time stamp after RFC 3161: {error}") from error


_HASHES = {"2.16.840.1.101.3.4.2.1": "sha256", "2.16.840.1.101.3.4.2.2": "sha384", "2.16.840.1.101.3.4.2.3": "sha512"}


def _stamps(response: Any, statement: bytes) -> bool:
    """Whether a response is a stamp of these bytes."""
    imprint = response.tst_info.message_imprint
    name = _HASHES.get(imprint.hash_algorithm.dotted_string)
    return name is not None and new(name, statement).digest() == bytes(imprint.message)


def _stamp_checked(told: Any, what: Sealed, authority: Path | None) -> Checked:
    response = _response(b64decode(str(told["time_stamp"]), validate=True), "the time stamp")
    when = response.tst_info.gen_time.isoformat()
    about = f"time stamp of {when}"
    if not _stamps(response, statement_to_stamp(what)):
        return Checked(False, "", "", when, f"DOES NOT HOLD: {about}: it is of something else")
    if authority is None:
        return Checked(
            True, "", "", when, f"{about}, whose authority was NOT verified: give its certificates, --authority PEM"
        )
    client, x509 = needed("rfc3161_client", "seal"), needed("cryptography.x509", "seal")
    try:
        builder = client.VerifierBuilder()
        for one in x509.load_pem_x509_certificates(_read(authority)):
            builder = builder.add_root_certificate(one)
        builder.build().verify_message(response, statement_to_stamp(what))
    except (client.VerificationError, ValueError) as error:
        return Checked(False, "", "", when, f"DOES NOT HOLD: {about}: {error}")
    return Checked(True, "", "", when, f"{about}, by an authority of {authority.name}")
