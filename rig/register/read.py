"""Reading the register: from a file, from beside a bench file, or from a run file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rig.bench.config import BenchConfig, parse_toml, read_text, validated
from rig.errors import UsageError
from rig.register.equipment_file import Register

DOCUMENT = "equipment.toml"
"""Name of the register among the documents of a run file, and of the file beside a bench file."""


def parse_register(text: str, where: str, *, strict: bool = True) -> Register:
    """Check the text of a register; `strict` as in `validated`. Raises `ConfigurationError`."""
    return validated(Register, parse_toml(text, where), where, strict=strict)


def read_register(path: Path) -> Register:
    """A register from its file. Raises `ConfigurationError`."""
    return parse_register(read_text(path, "equipment"), str(path))


def register_beside(config: BenchConfig, bench: Path) -> tuple[Path, str] | None:
    """Path and text of the register that a bench file names, or that is beside it; None if there is none.

    Raises:
        ConfigurationError: it is named, and cannot be read.
    """
    path = bench.parent / (config.equipment or DOCUMENT)
    if not config.equipment and not path.exists():
        return None
    return path, read_text(path, "equipment")


def register_of(documents: Mapping[str, str], given: Path | None = None, *, run: str = "the run file") -> Register:
    """The register of a run: the given file, or the one kept with the run.

    Args:
        documents: of the run file, by name.
        given: another register, for runs without one or with one that was corrected since.
        run: name of the run, for messages.

    Raises:
        ConfigurationError: it cannot be used.
        UsageError: there is none.
    """
    if given is not None:
        return read_register(given)
    if DOCUMENT not in documents:
        raise UsageError(
            f"{run} has no register of equipment: name one with --equipment FILE (docs/how_to/register.md)"
        )
    return parse_register(documents[DOCUMENT], f"{run} ({DOCUMENT})", strict=False)
