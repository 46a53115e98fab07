"""Files of certificates: numbers, forms that are written once and never replaced, and what an amendment changes."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from rig.certificate.document import Amendment
from rig.certificate.seal import hash_of
from rig.errors import UsageError

FORMS = ("pdf", "html", "xml", "json")
_MOST_CHANGES = 20
_NEVER = (("number",), ("amends",), ("dates", "issued"))
"""Parts of a document that differ in every amendment."""


def check_number(number: str) -> str:
    """A number that is a file name, too. Raises `UsageError`."""
    if not number or number != number.strip() or number.startswith(".") or set(number) & set('/\\:*?"<>|'):
        raise UsageError(f"number {number!r} cannot be the name of a file: use letters, digits, -, _ and points")
    return number


def taken(folder: Path, number: str) -> list[Path]:
    """Existing files of a certificate."""
    return [path for form in FORMS if (path := folder / f"{number}.{form}").exists() or path.is_symlink()]


def next_number(folder: Path, scheme: str, issued: date) -> str:
    """The first number by a scheme of which no file exists. Raises `UsageError` if the scheme makes none."""
    for n in range(1, 1_000_000):
        try:
            number = check_number(scheme.format(year=issued.year, next=n))
        except (KeyError, IndexError, ValueError) as error:
            raise UsageError(f"number = {scheme!r} has unknown fields: use {{year}} and {{next:04d}}") from error
        if not taken(folder, number):
            return number
    raise UsageError(f"no number of {scheme!r} is free in {folder}")


def number_of_amendment(folder: Path, original: str) -> str:
    """The number of the next amendment: the original's with -1, -2 and so on, also of what replaces an amendment."""
    return next_number(folder, original.replace("{", "{{").replace("}", "}}") + "-{next}", date.min)


def write_once(folder: Path, number: str, forms: Mapping[str, bytes]) -> list[Path]:
    """Write all forms of a certificate, or none. An existing file is never replaced.

    Args:
        folder: made if it does not exist.
        number: of the certificate.
        forms: contents by form.

    Raises:
        UsageError: a file of this number exists, or the disk refuses.
    """
    written: list[Path] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for form, contents in forms.items():
            path = folder / f"{number}.{form}"
            made = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
            written.append(path)
            with os.fdopen(made, "wb") as file:
                file.write(contents)
                file.flush()
                os.fsync(made)
    except BaseException as error:
        for path in written:
            with contextlib.suppress(OSError):
                path.unlink()
        if isinstance(error, FileExistsError):
            raise _exists(number, folder) from error
        if isinstance(error, OSError):
            raise UsageError(f"{folder} cannot be written to: {error.strerror}; nothing was written") from error
        raise
    return written


def check_free(folder: Path, number: str) -> None:
    """Refuse a number that has a certificate. Raises `UsageError`."""
    if taken(folder, number):
        raise _exists(number, folder)


def _exists(number: str, folder: Path) -> UsageError:
    return UsageError(
        f"certificate {number} exists in {folder} and is never overwritten: --amends {number} makes one that "
        f"replaces it"
    )


@dataclass(frozen=True)
class Before:
    """A certificate that is amended: its JSON values, the hash of its XML, or of its JSON, and the first one of all.

    Attributes:
        told: JSON values.
        sha256: of its XML; of its JSON if there is none.
        original: number and date of issue of the first certificate.
    """

    told: Mapping[str, Any]
    sha256: str
    original: tuple[str, date]


def amended(folder: Path, number: str) -> Before:
    """The certificate that an amendment replaces.

    Raises:
        UsageError: its files are not there, or another amendment has replaced it.
    """
    path = folder / f"{number}.json"
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        issued, earlier = told["dates"]["issued"], told.get("amends") or {}
        first = check_number(earlier.get("original", number)), earlier.get("original_issued", issued)
        date.fromisoformat(issued)
        original = first[0], date.fromisoformat(first[1])
        if told["number"] != number:
            raise ValueError(f"it is of number {told['number']}")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, UsageError) as error:
        raise UsageError(f"certificate {number} cannot be amended: {path} cannot be read ({error})") from error
    for other in sorted(folder.glob("*.json")):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            later = json.loads(other.read_text(encoding="utf-8"))
            if (later.get("amends") or {}).get("number") == number:
                raise UsageError(f"certificate {number} was replaced by {later['number']}: --amends {later['number']}")
    xml = folder / f"{number}.xml"
    return Before(told, hash_of(xml if xml.exists() else path), original)


def amendment(before: Before, now: Mapping[str, Any], because: str) -> Amendment:
    """The words of an amendment: the reason, and every changed part.

    Args:
        before: the amended certificate.
        now: JSON values of the new one.
        because: the reason, a sentence; "" for none.

    Raises:
        UsageError: nothing changed, and there is no reason.
    """
    changed = changes(before.told, now)
    if not changed and not because:
        raise UsageError("nothing changed: an amendment needs a change, or a reason (--because)")
    told = [because.strip()] if because.strip() else []
    issued = date.fromisoformat(before.told["dates"]["issued"])
    return Amendment(str(before.told["number"]), issued, (*told, *changed), before.sha256, *before.original)


def changes(old: Mapping[str, Any], new: Mapping[str, Any], most: int = _MOST_CHANGES) -> tuple[str, ...]:
    """Differences of two trees of values, as sentences; of more than `most` the first, and their number."""
    found = [f"{where}: {_shown(one)} is now {_shown(other)}" for where, one, other in _changes(old, new)]
    left = len(found) - most
    return (*found[:most], *([f"and {left} further values"] if left > 0 else []))


def _changes(old: Any, new: Any, where: tuple[str, ...] = ()) -> Iterator[tuple[str, Any, Any]]:
    """Place, old and new value of every difference."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for name in dict.fromkeys([*old, *new]):
            if (*where, name) in _NEVER:
                continue
            yield from _changes(old.get(name), new.get(name), (*where, name))
    elif isinstance(old, list) and isinstance(new, list):
        for n in range(max(len(old), len(new))):
            first, then = (part[n] if n < len(part) else None for part in (old, new))
            yield from _changes(first, then, (*where, _name(first if first is not None else then, n)))
    elif old != new:
        yield " ".join(where).replace("_", " "), old, new


def _name(part: Any, n: int) -> str:
    """Name of an entry of a list, or its ordinal."""
    if isinstance(part, Mapping):
        for key in ("sensor", "name", "label", "result"):
            if part.get(key):
                return str(part[key])
    return str(n + 1)


def _shown(value: Any) -> str:
    if value in (None, "", [], {}):
        return "nothing"
    if isinstance(value, Mapping | list):
        return "a new entry"
    return str(value)
