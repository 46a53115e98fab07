"""Fits of runs with a register of equipment: corrected by certificates, with influences kept for use."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.errors import ConfigurationError, UsageError
from rig.procedures.errors import DataError
from rig.procedures.present.shell import shell_word
from rig.tables import FileSource, is_run

if TYPE_CHECKING:  # most tables have no register
    from rig.procedures.tables.table import Table
    from rig.procedures.tables.within import Within
    from rig.verbs.budget.evaluation import Evaluated, OfRun

REPEATABILITY = "repeatability only"


@dataclass(frozen=True)
class Corrected:
    """A run with the corrections of its certificates. See `rig.procedures.evaluate.results.Source`.

    Attributes:
        name: for messages.
        table: the corrected table.
    """

    name: str
    table: Table

    @property
    def is_run(self) -> bool:
        """True: only runs have corrections."""
        return True

    def read(self, needed: Collection[str]) -> Table:
        """The table, which has all columns."""
        return self.table

    @property
    def understood(self) -> Mapping[str, Any]:
        """A run file needs no interpretation."""
        return {}

    @property
    def within(self) -> Mapping[str, Within]:
        """Readings of which the rows are means, by column."""
        return self.table.within


@dataclass(frozen=True)
class Registered:
    """The register of the data to be fitted.

    Attributes:
        run: the run with its register; None without one.
        why: why there is none.
        equipment: the given register, in place of those of the runs; None if there is none.
        segments: its file, and those of replications that were added to it; () if none were.
    """

    run: OfRun | None
    why: str
    equipment: Path | None = None
    segments: tuple[Path, ...] = ()

    def source(self, own: FileSource) -> Any:
        """The corrected run, with the added replications; the file itself without either."""
        if self.run is not None:
            return Corrected(self.run.table.source, self.run.table)
        if not self.segments:
            return own
        from rig.tables.segments import joined  # noqa: PLC0415

        return Corrected(own.name, joined(self.segments))

    def table_of(self, path: Path) -> Table:
        """The table of a run file, which is corrected if this run is; of this one with the added replications.

        Raises:
            UsageError: it is no run file, or this run is corrected and that one has no register.
            ConfigurationError: its register cannot be used.
        """
        from rig.tables.segments import joined  # noqa: PLC0415
        from rig.verbs.budget.evaluation import run_with_register  # noqa: PLC0415

        own = bool(self.segments) and path.resolve() == self.segments[0].resolve()
        more = self.segments[1:] if own else ()
        return joined((path, *more)) if self.run is None else run_with_register(path, self.equipment, more).table

    def uncertainty(
        self,
        given: Mapping[str, Any],
        others: Sequence[str],
        evaluated: Evaluated | None = None,
        without: Sequence[str] = (),
        *,
        keep: bool,
    ) -> Uncertainty:
        """Uncertainties of a fit, with influences for its use if it is kept.

        Args:
            given: options of its kind.
            others: further options that were given, of whose model there is no evaluation.
            evaluated: the evaluation by the model of the fit; None for that of `rig budget` with the same options.
            without: effects that are known and not in the model.
            keep: whether it is written to a file.
        """
        if self.run is None:
            return Uncertainty(f"{REPEATABILITY}: {self.why}")
        known = self.run.kind.budget_options.model_fields
        beyond = [*others, *(f"--{name.replace('_', '-')}" for name in given if name not in known)]
        if beyond:
            return Uncertainty(f"{REPEATABILITY}: influences are those of a fit without {', '.join(beyond)}")
        if not keep:
            return Uncertainty(f"{REPEATABILITY}: rig budget {shell_word(self.run.table.source)} gives uncertainties")
        from rig.verbs.data.kept import budget_section  # noqa: PLC0415 - few fits are kept

        run, options = self.run, {name: given[name] for name in known if name in given}
        chosen = run.kind.budget_options(**options)
        by_model = evaluated or partial(run.kind.evaluation, run.table, chosen)
        lacks = None if evaluated is None and not options.get("traced") else without
        try:
            section = budget_section(run, by_model, options, lacks)
        except DataError as error:
            return Uncertainty(f"{REPEATABILITY}: {error}")
        return Uncertainty(f"{REPEATABILITY} here; rig infer adds the influences of the register", section)


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainties that the intervals of a fit have.

    Attributes:
        words: that they are repeatability only, and why or where there are others.
        section: influences for its use; None without.
    """

    words: str = ""
    section: Mapping[str, Any] | None = None

    def to_json(self) -> dict[str, Any]:
        """Further JSON values of the fit."""
        more = {} if self.section is None else {"budget": self.section}
        return {"uncertainty": self.words, **more} if self.words else more


def registered(source: FileSource, equipment: Path | None, added: Sequence[Path] = ()) -> Registered:
    """The run of a source with its register, and with replications that were added to it.

    Raises:
        UsageError: a register was given for something that is no run.
        ConfigurationError: the given register cannot be used.
    """
    if not is_run(source.path):
        if equipment is not None:
            raise UsageError(f"--equipment is for run files, and {source.path} is a table")
        return Registered(None, "a table has no register of equipment")
    from rig.register import DOCUMENT  # noqa: PLC0415
    from rig.run_file.read.reader import RunReader  # noqa: PLC0415
    from rig.verbs.budget.evaluation import run_with_register  # noqa: PLC0415

    segments = (source.path, *added) if added else ()
    if equipment is not None:
        return Registered(run_with_register(source.path, equipment, added), "", equipment, segments)
    with RunReader.open(source.path) as reader:
        has_one = DOCUMENT in reader.documents()
    if not has_one:
        return Registered(None, "the run has no register of equipment (docs/how_to/register.md)", segments=segments)
    try:
        return Registered(run_with_register(source.path, more=added), "", segments=segments)
    except ConfigurationError as error:
        return Registered(None, f"its register of equipment cannot be used: {error}", segments=segments)
