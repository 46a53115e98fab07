"""Files of a laboratory by name: names are looked up here, and never used as paths."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rig.bench.config import parse_toml, read_text
from rig.errors import ConfigurationError, UsageError
from rig.lab import Laboratory
from rig.queue import Queue, QueueFile, open_queue
from rig.run_file.verify.verification import LOOP_SUFFIX

CERTIFICATE = "certificate.toml"
WITH_SECRETS = ("people.toml", "notify.toml")
"""Files that have passwords and keys."""
FOLDERS = ("runs", "proposals", "reports", "calibrations", "certificates")
"""Folders of a laboratory that have a meaning."""
_MOST = 2000
"""Files of a sort that are looked at, the newest first."""


@dataclass(frozen=True)
class Places:
    """The files of a laboratory."""

    laboratory: Laboratory

    @property
    def folder(self) -> Path:
        """Its folder."""
        return self.laboratory.folder

    @property
    def runs_folder(self) -> Path:
        """The folder of new runs."""
        return self.folder / "runs"

    @property
    def queue_file(self) -> Path:
        """The file of its queue."""
        return self.runs_folder / "queue.sqlite"

    def queue(self) -> tuple[QueueFile, Queue]:
        """Its queue, and the state of it."""
        return open_queue(self.queue_file)

    def runs(self) -> dict[str, Path]:
        """Run files and program files, the newest first, by name without the ending."""
        patterns = ("runs/*.sqlite", "runs/*/*.sqlite", "proposals/*.sqlite")
        found = [one for one in self._newest(*patterns) if one != self.queue_file]
        return {_text(path.name.removesuffix(".sqlite")): path for path in reversed(found)}

    def run(self, name: str) -> Path:
        """A run file by its name. Raises `UsageError`."""
        path = self.runs().get(name)
        if path is None:
            raise UsageError(f"there is no run {name!r:.100} in {self.folder}")
        return path

    def benches(self) -> dict[str, Path]:
        """Bench files by their path in the folder."""
        return self._of_sort("bench")

    def procedures(self, bench: Path | None = None) -> dict[str, Path]:
        """Procedure files by their path in the folder; with a bench, those in its folder."""
        every = self._of_sort("procedure")
        return {name: path for name, path in every.items() if bench is None or path.parent == bench.parent}

    def _of_sort(self, sort: str) -> dict[str, Path]:
        return {name: path for name, path in self._toml().items() if self.sort_of(_values(path)) == sort}

    def sort_of_file(self, path: Path) -> str:
        """The sort of a settings file as it is now."""
        return self.sort_of(_values(path))

    @staticmethod
    def sort_of(values: Mapping[str, object]) -> str:
        """The sort of a settings file by its values: "bench", "procedure", "register", "instrument", or "other"."""
        if "instruments" in values:
            return "bench"
        if "kind" in values:
            return "procedure"
        if isinstance(values.get("equipment"), dict):
            return "register"
        return "instrument" if {"wire", "identity", "scpi"} & values.keys() else "other"

    def bench(self, name: str) -> Path:
        """A bench file by its name. Raises `UsageError`."""
        return _one(self.benches(), name, "bench file")

    def procedure(self, name: str) -> Path:
        """A procedure file by its name. Raises `UsageError`."""
        return _one(self.procedures(), name, "procedure file")

    def people(self) -> dict[str, str]:
        """Names of the people by login."""
        return {login: one.name for login, one in self.laboratory.people().people.items()}

    def registers(self) -> dict[str, Path]:
        """Registers of equipment by their path in the folder."""
        return self._of_sort("register")

    def instruments(self) -> dict[str, Path]:
        """Files of declared instruments by their path in the folder."""
        return self._of_sort("instrument")

    def settings(self) -> dict[str, Path]:
        """Settings files that pages may show and change, by their path in the folder: none with secrets, none by links.

        Example:
            >>> "people.toml" in Places(Laboratory(Path("."))).settings()
            False
        """
        inside = self.folder.resolve()
        return {
            name: path for name, path in self._toml().items() if path.name not in WITH_SECRETS and _own(path, inside)
        }

    def setting(self, name: str) -> Path:
        """A settings file by its name. Raises `UsageError`."""
        return _one(self.settings(), name, "settings file")

    def certificate_settings(self, run: Path) -> Path:
        """Settings of a run's certificate: those beside the bench of its item of the queue, or of the laboratory."""
        file, queue = self.queue()
        benches = (one.bench for one in queue.items.values() if run.parent == file.folder_of(one.number))
        beside = Path(next(benches, self.folder)).with_name(CERTIFICATE)
        return beside if beside.is_file() else self.folder / CERTIFICATE

    def documents(self) -> dict[str, Path]:
        """Reports, certificates and calibrations, the newest first, by their path in the folder; nothing by links."""
        inside = self.folder.resolve()
        patterns = [
            f"{folder}*.{form}"
            for folder in ("reports/", "calibrations/", "certificates/", "runs/", "runs/*/")
            for form in ("html", "pdf", "xml", "json")
        ]
        found = self._newest(*patterns)
        return {_text(str(path.relative_to(self.folder))): path for path in found if _own(path, inside)}

    def _toml(self) -> dict[str, Path]:
        found = sorted([*self.folder.glob("*.toml"), *self.folder.glob("*/*.toml")])[:_MOST]
        return {_text(str(path.relative_to(self.folder))): path for path in found if path.is_file()}

    def _newest(self, *patterns: str) -> list[Path]:
        found = {path: _changed(path) for pattern in patterns for path in self.folder.glob(pattern) if path.is_file()}
        return sorted(found, key=lambda path: found[path], reverse=True)[:_MOST]


def is_loop(path: Path) -> bool:
    """Whether it is the program file of a loop."""
    return path.name.endswith(LOOP_SUFFIX)


def _own(path: Path, inside: Path) -> bool:
    """Whether it is no link, and in no linked folder outside of the laboratory's."""
    return not path.is_symlink() and path.resolve().is_relative_to(inside)


def _one(known: dict[str, Path], name: str, what: str) -> Path:
    if name not in known:
        raise UsageError(f"there is no {what} {name!r:.100} here (known: {', '.join(sorted(known)) or 'none'})")
    return known[name]


def _text(name: str) -> str:
    """A name as text; bytes that are none are escaped."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


_READ: dict[Path, tuple[int, int, dict[str, object]]] = {}


def _values(path: Path) -> dict[str, object]:
    """Values of a TOML file, {} if it is none; read again only after a change."""
    try:
        stat = path.stat()
        known = _READ.get(path)
        if known is None or known[:2] != (stat.st_mtime_ns, stat.st_size):
            known = _READ[path] = (stat.st_mtime_ns, stat.st_size, parse_toml(read_text(path, "settings"), str(path)))
    except (OSError, ConfigurationError):
        return {}
    return known[2]
