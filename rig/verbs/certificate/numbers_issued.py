"""Register of the certificates that a laboratory has issued: one number is one certificate, in whatever folder it is.

A JSON file beside the settings. A number is entered before its files get their names and after its mark is there, so
that what a kill leaves is known, and no number is given twice.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from rig.errors import UsageError
from rig.files.atomic import write_whole
from rig.files.temporary import locked
from rig.verbs.certificate.document import Document


@dataclass(frozen=True)
class Entry:
    """An issued certificate.

    Attributes:
        number: its number.
        issued: date of issue, ISO 8601.
        runs: what it is of: identifiers of runs; SHA-256 of tables.
        folder: where its files were written.
        sha256: of its JSON.
        amends: number of the certificate that it replaces; "" for none.
    """

    number: str
    issued: str
    runs: tuple[str, ...]
    folder: str
    sha256: str
    amends: str = ""


_ENTRIES = TypeAdapter(tuple[Entry, ...])


@dataclass
class Issued:
    """The register, while its lock is held.

    Attributes:
        path: the file.
        entries: what it has.
    """

    path: Path
    entries: tuple[Entry, ...] = field(default=())

    @property
    def numbers(self) -> frozenset[str]:
        """All numbers that are issued."""
        return frozenset(one.number for one in self.entries)

    def of(self, number: str) -> Entry | None:
        """The certificate of a number; None if it is free."""
        return next((one for one in self.entries if one.number == number), None)

    def of_runs(self, runs: Sequence[str]) -> Sequence[Entry]:
        """Certificates of any of these runs or tables."""
        return [one for one in self.entries if set(one.runs) & set(runs)]

    def of_amendment(self, number: str) -> Entry | None:
        """The certificate that replaces one; None if it holds."""
        return next((one for one in self.entries if one.amends == number), None)

    def check_replaces(self, number: str) -> None:
        """Refuse a second certificate that replaces one. Raises `UsageError`."""
        later = self.of_amendment(number)
        if later is not None:
            raise UsageError(f"certificate {number} was replaced by {later.number}: --amends {later.number}")

    def discard(self, folder: Path, numbers: Sequence[str]) -> None:
        """Free numbers whose issue was cut in a folder."""
        cut = [one for one in self.entries if one.number in numbers and one.folder == str(folder.resolve())]
        if cut:
            self._write(tuple(one for one in self.entries if one not in cut))

    @contextlib.contextmanager
    def entered(self, entry: Entry) -> Iterator[None]:
        """A number is issued; if its files cannot be written, it is not."""
        before = self.entries
        self._write((*before, replace(entry, folder=str(Path(entry.folder).resolve()))))
        try:
            yield
        except BaseException:
            self._undone(before)
            raise

    def _undone(self, before: tuple[Entry, ...]) -> None:
        self._write(before)

    def _write(self, entries: tuple[Entry, ...]) -> None:
        told = json.dumps([asdict(one) for one in entries], indent=1, ensure_ascii=False)
        write_whole(self.path, lambda file: file.write(f"{told}\n"))
        self.entries = entries


def runs_of(document: Document) -> tuple[str, ...]:
    """Runs and tables of a certificate, as in `Entry.runs`."""
    return tuple(one.run_id or one.head for one in document.evidence)


@contextlib.contextmanager
def numbers_issued(path: Path, out: Path) -> Iterator[Issued]:
    """The register of a laboratory, with its lock.

    Args:
        path: the file; there is none before the first certificate.
        out: folder of the certificates, which has a lock of its own.

    Raises:
        UsageError: it cannot be read or locked.
    """
    if not path.parent.is_dir():
        raise UsageError(f"{path}: its folder is missing; correct `numbers` in the settings of the laboratory")
    with contextlib.nullcontext() if path.parent.resolve() == out.resolve() else locked(path.parent):
        try:
            entries = _ENTRIES.validate_json(path.read_bytes()) if path.exists() else ()
        except (OSError, ValidationError) as error:
            raise UsageError(
                f"{path}: the register of issued numbers cannot be read ({str(error).splitlines()[0]}): restore it "
                "from a backup; without it a number could be given twice"
            ) from error
        yield Issued(path, entries)


def changed_rules(old: Mapping[str, Any], new: Document) -> str:
    """How tolerances or decision rules differ from those of an earlier certificate, a sentence; "" if they do not."""

    def rules(statements: Sequence[Mapping[str, Any]]) -> dict[tuple[str, ...], str]:
        keys = ("sensor", "stage", "what")
        return {tuple(str(s.get(k, "")) for k in keys): f"{s['tolerance']}, {s['rule']}" for s in statements}

    before, now = rules(old.get("statements", ())), rules([asdict(one) for one in new.statements])
    found = [
        f"{' '.join(filter(None, key))}: {before.get(key, 'none')}; now {now.get(key, 'none')}"
        for key in dict.fromkeys([*before, *now])
        if before.get(key) != now.get(key)
    ]
    words = "Tolerances or decision rules were changed after the results were known"
    return f"{words}: {'. '.join(found)}." if found else ""
