"""A stranger's set: its contract, its seal, and when it was opened."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from rig.drivers.clock import RealClock
from rig.fitter.arrays import FloatArray
from rig.errors import UsageError

KINDS = ("attitude", "whole_plots", "general")
"""Kinds of tables: each has a module of this name in a set."""
SEAL = "SEAL.txt"
OPENED = "OPENED.txt"


class Made(Protocol):
    """A table as a set makes it.

    Attributes:
        csv: text of the table.
        options: of `rig trace`, as on the command line; for tables of any kind only.
        size: achieved.
        hidden: (rows,) what the effects add to the first response, in its unit.

    """

    csv: str
    options: Sequence[str]
    size: float
    hidden: FloatArray


class Package(Protocol):
    """What a set's folder is as a package."""

    def table(self, kind: str, effects: Sequence[str], seed: int, size: float, noise: str = "white") -> Made:
        """A table with some effects of a kind; the same for the same arguments."""


@dataclass(frozen=True)
class StrangerSet:
    """A set that has been loaded.

    Attributes:
        folder: where it is.
        seal: SHA-256 of its files.
        package: makes its tables.
        modules: by kind.

    """

    folder: Path
    seal: str
    package: Package
    modules: Mapping[str, ModuleType]

    def effects(self, kind: str) -> list[tuple[str, ...]]:
        """Every effect by itself, then pairs."""
        module: Any = self.modules[kind]
        return [*((name,) for name in module.EFFECTS), *(tuple(pair) for pair in module.PAIRS)]

    def noises(self, kind: str) -> list[str]:
        """Names of the noises of tables with nothing hidden."""
        module: Any = self.modules[kind]
        return list(module.NOISES)

    def about(self, kind: str, name: str) -> str:
        """What an effect is, in the stranger's words, in one line."""
        module: Any = self.modules[kind]
        return " ".join(str(module.ABOUT[name]).split())


def files_of(folder: Path) -> list[Path]:
    """The sealed files: all Python files of the folder, by name."""
    return sorted(folder.glob("*.py"), key=lambda path: path.name.encode())


def digest_of(folder: Path) -> str:
    """SHA-256 of the files one after another, as `cat $(ls *.py | LC_ALL=C sort) | sha256sum`."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in files_of(folder))).hexdigest()


def sealed(folder: Path) -> str:
    """The seal of a set, checked.

    `SEAL.txt` has that of the files one after another, or a line for each file as `sha256sum *.py` writes them.

    Raises:
        UsageError: there is no seal, or the files are not those that were sealed.

    """
    path = folder / SEAL
    if not path.is_file():
        raise UsageError(f"{folder}: there is no {SEAL}; a set is sealed before anything of it is traced")
    text = path.read_text(encoding="utf-8")
    digest = digest_of(folder)
    each = dict(re.findall(r"^([0-9a-f]{64}) [ *](\S+\.py)$", text, re.M))
    names = {found: name for name, found in each.items()}
    of_each = {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files_of(folder)}
    if names:
        wrong = sorted(name for name in {*names, *of_each} if names.get(name) != of_each.get(name))
        if wrong:
            raise UsageError(f"{folder}: the seal is broken: {', '.join(wrong)} changed after sealing")
    elif digest not in re.findall(r"\b[0-9a-f]{64}\b", text):
        raise UsageError(f"{folder}: the seal is broken: the files are not those of {SEAL}")
    return digest


@cache
def load(folder: Path) -> StrangerSet:
    """A set from any folder; its seal is checked first, and its code runs here.

    Raises:
        UsageError: the seal is missing or broken, or the folder does not keep the contract.

    """
    folder = folder.resolve()
    seal = sealed(folder)
    name = f"stranger_{seal[:16]}"
    spec = importlib.util.spec_from_file_location(
        name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None or spec.loader is None or not (folder / "__init__.py").is_file():
        raise UsageError(f"{folder}: there is no __init__.py; a set is a package with table(...)")
    package: Any = importlib.util.module_from_spec(spec)
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.modules[name] = package
    try:
        spec.loader.exec_module(package)
        modules = {kind: import_module(f"{name}.{kind}") for kind in KINDS if (folder / f"{kind}.py").is_file()}
    except Exception as error:
        del sys.modules[name]
        raise UsageError(f"{folder}: the set cannot be loaded: {type(error).__name__}: {error}") from error
    finally:
        sys.dont_write_bytecode = writes
    for kind, module in modules.items():
        lacking = [one for one in ("EFFECTS", "PAIRS", "ABOUT", "NOISES") if not hasattr(module, one)]
        if lacking:
            raise UsageError(f"{folder}/{kind}.py has no {', '.join(lacking)}")
    if not modules or not hasattr(package, "table"):
        raise UsageError(f"{folder}: a set has table(...) and a module for each kind: {', '.join(KINDS)}")
    return StrangerSet(folder, seal, package, modules)


def opened(stranger: StrangerSet) -> str:
    """Date and time of the first trace of a set, from its `OPENED.txt`; this is the first if there is none yet.

    Raises:
        UsageError: it was another set that was opened.

    """
    path = stranger.folder / OPENED
    try:
        with path.open("x", encoding="utf-8") as file:
            when = datetime.fromtimestamp(RealClock().utc(), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
            file.write(json.dumps({"opened": when, "seal": stranger.seal}) + "\n")
    except FileExistsError:
        pass
    text = path.read_text(encoding="utf-8")
    told = json.loads(text) if text.strip() else {"opened": "", "seal": stranger.seal}  # another worker writes it now
    if told["seal"] != stranger.seal:
        raise UsageError(f"{path}: it was a set with another seal that was opened")
    return str(told["opened"])
