"""Files of certificates: numbers, forms that are written once and never replaced, and what an amendment changes."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from rig.errors import UsageError
from rig.files.temporary import locked, open_temporary, sweep, sync_folder, temporary_in
from rig.verbs.certificate.changes import changes
from rig.verbs.certificate.document import Amendment
from rig.verbs.certificate.seals import hash_of

FORMS = ("pdf", "html", "xml", "json")
COMMIT = "json"
"""The form that is written last: with it, a certificate is issued."""


def check_number(number: str) -> str:
    """A number that is a file name, too. Raises `UsageError`."""
    if not number or number != number.strip() or number.startswith(".") or set(number) & set('/\\:*?"<>|'):
        raise UsageError(f"number {number!r} cannot be the name of a file: use letters, digits, -, _ and points")
    return number


def taken(folder: Path, number: str) -> list[Path]:
    """Existing files of a certificate."""
    return [path for form in FORMS if (path := folder / f"{number}.{form}").exists() or path.is_symlink()]


def next_number(folder: Path, scheme: str, issued: date, known: Collection[str] = ()) -> str:
    """The first number by a scheme that is not `known` and has no file. Raises `UsageError` if there is none."""
    for n in range(1, 1_000_000):
        try:
            number = check_number(scheme.format(year=issued.year, next=n))
        except (KeyError, IndexError, ValueError) as error:
            raise UsageError(f"number = {scheme!r} has unknown fields: use {{year}} and {{next:04d}}") from error
        if number not in known and not taken(folder, number):
            return number
    raise UsageError(f"no number of {scheme!r} is free in {folder}")


def number_of_amendment(folder: Path, original: str, known: Collection[str] = ()) -> str:
    """The number of the next amendment: the original's with -1, -2 and so on, also of what replaces an amendment."""
    return next_number(folder, original.replace("{", "{{").replace("}", "}}") + "-{next}", date.min, known)


def write_once(
    folder: Path,
    number: str,
    forms: Mapping[str, bytes],
    entered: contextlib.AbstractContextManager[None] | None = None,
) -> list[Path]:
    """Write all forms of a certificate, or none. An existing file is never replaced.

    All forms are durable under temporary names before one gets its own. The JSON is the last: a certificate is issued
    when it is there. Until then `.NUMBER.issuing` stands for it, so that the files of an issue that was cut are known.

    Args:
        folder: made if it does not exist; the caller has its lock (`issuing`).
        number: of the certificate.
        forms: contents by form.
        entered: enters the number in the register of the laboratory, while the mark is there; undone by an error.

    Raises:
        UsageError: a file of this number exists, or the disk refuses.
    """
    made: dict[Path, Path] = {}
    written: list[Path] = []
    mark = _mark(folder, number)
    *before, last = sorted(((folder / f"{number}.{form}", form) for form in forms), key=lambda one: one[1] == COMMIT)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        sweep(folder)
        for path, form in (*before, last):
            made[path] = temporary_in(folder)
            with open_temporary(made[path]) as file:
                file.write(forms[form])
                file.flush()
                os.fsync(file.fileno())
        check_free(folder, number)
        os.replace(made[last[0]], mark)
        sync_folder(folder)
        with entered or contextlib.nullcontext():
            for path, _ in before:
                _name(made[path], path)
                written.append(path)
            sync_folder(folder)
            _name(mark, last[0])
            written.append(last[0])
            sync_folder(folder)
    except BaseException as error:
        for path in (*reversed(written), mark):  # the JSON first
            with contextlib.suppress(OSError):
                path.unlink()
        if isinstance(error, FileExistsError):
            raise _exists(number, folder) from error
        if isinstance(error, OSError):
            raise UsageError(f"{folder} cannot be written to: {error.strerror}; nothing was written") from error
        raise
    finally:
        for path in made.values():
            with contextlib.suppress(OSError):
                path.unlink()
    with contextlib.suppress(OSError):
        mark.unlink()
    return [folder / f"{number}.{form}" for form in forms]


def _name(file: Path, path: Path) -> None:
    """Give a file its name. Raises `FileExistsError` if there is one, which a rename alone would replace."""
    try:
        os.link(file, path)
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        if path.exists() or path.is_symlink():  # a file system without links, such as that of a memory stick
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        os.rename(file, path)


@contextlib.contextmanager
def issuing(folder: Path) -> Iterator[list[str]]:
    """Hold the lock of a folder while a number is chosen and its files are written; the folder is made.

    Returns:
        Numbers whose issue was cut before its JSON was there: these certificates were never issued, and their files
        have been removed.

    Raises:
        UsageError: the folder cannot be made or locked.
    """
    new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}; choose another folder") from error
    try:
        with locked(folder):
            yield [name for mark in sorted(folder.glob(".*.issuing")) if _discarded(folder, name := mark.name[1:-8])]
    except BaseException:
        if new:
            with contextlib.suppress(OSError):  # only an empty one is removed
                folder.rmdir()
        raise


def _discarded(folder: Path, number: str) -> bool:
    """Remove the mark of an issue that was cut; if the JSON is not there, the other files, too, and say so.

    Files without a mark are not touched: a person may have moved the JSON away.
    """
    cut = not (folder / f"{number}.{COMMIT}").exists()
    for path in taken(folder, number) if cut else ():
        path.unlink()
    _mark(folder, number).unlink()
    return cut


def _mark(folder: Path, number: str) -> Path:
    return folder / f".{number}.issuing"


def check_free(folder: Path, number: str) -> None:
    """Refuse a number that has a certificate. Raises `UsageError`."""
    found = taken(folder, number)
    if not found:
        return
    if not (folder / f"{number}.{COMMIT}").exists():
        names = " and ".join(path.name for path in found)
        raise UsageError(
            f"{folder} has {names} and no {number}.{COMMIT}: the certificate was cut while it was written, or its "
            f"{COMMIT} was moved. They are never overwritten: bring that back, or move {names} away if nobody has it"
        )
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
