"""The definition of a run by its own file: the plan for the consistency checks of its records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, cast

from rig.bench.config import BenchConfig, parse_procedure
from rig.bench.contract_files import bench_of_run
from rig.bench.plugins import driver_class, may_repeat
from rig.bench.typed import TypedColumn, typed_columns
from rig.drivers.roles import ByHand
from rig.errors import ConfigurationError
from rig.procedures.column_names import unit_of
from rig.procedures.kind import Procedure
from rig.procedures.plan.conduct import Conduct, EnvironmentSettings, SoakSettings
from rig.procedures.plan.run_list import Factor, RunList
from rig.run_file.chain import Record
from rig.run_file.events.bench import Emerging
from rig.run_file.events.event import Event
from rig.run_file.events.sessions import ClockSet, NotNotified, RunCreated
from rig.run_file.read.reader import RunReader
from rig.run_file.state.state import RunState
from rig.units.of_instruments import TEMPERATURE_UNIT

NOTED = (NotNotified, ClockSet, Emerging)
"""Events that may be written between two records that otherwise are consecutive."""


@dataclass(frozen=True)
class RecordedRun:
    """A run by its own file.

    Attributes:
        genesis: the first record.
        about: its event.
        run_list: every point.
        documents: file texts by name.
        procedure: None if this version of rig cannot read it.
        bench: likewise.

    """

    genesis: Record
    about: RunCreated
    run_list: RunList
    documents: Mapping[str, str]
    procedure: Procedure | None
    bench: BenchConfig | None

    @classmethod
    def of(cls, run: RunReader) -> RecordedRun:
        """The case of an open run file."""
        documents = run.documents()
        return cls(run.genesis(), run.about(), run.run_list(), documents, _procedure(documents), _bench(documents))

    @cached_property
    def conduct(self) -> Conduct | None:
        """Planned approach and reading of its points; None if the procedure cannot be read."""
        return None if self.procedure is None else self.procedure.conduct

    @cached_property
    def may_repeat(self) -> frozenset[str]:
        """Outputs whose readings may repeat to the last digit: those of a coarse display."""
        if self.bench is None:
            return frozenset()
        instruments = self.bench.instruments
        coarse = {name for name, one in instruments.items() if one.coarse or may_repeat(one.driver)}
        return frozenset(f"{name}_{one.unit}" for name, one in self.bench.sensors.items() if one.reader in coarse)

    @cached_property
    def typed(self) -> Mapping[str, TypedColumn]:
        """Columns that a person reads; {} if bench or procedure cannot be read."""
        return {} if self.bench is None or self.conduct is None else typed_columns(self.bench, self.conduct)

    @property
    def soak(self) -> SoakSettings | None:
        """Criteria of soaking; None if it has no whole plots."""
        plots = None if self.conduct is None else self.conduct.whole_plots
        return None if plots is None else plots.soak

    @property
    def environment(self) -> EnvironmentSettings | None:
        """Requested environment, if any."""
        return None if self.conduct is None else self.conduct.environment

    @cached_property
    def by_hand(self) -> frozenset[str]:
        """Factors that a person sets."""
        if self.bench is None:
            return frozenset()
        drivers = {factor: self.bench.instruments[name].driver for factor, name in self.bench.factors.items()}
        return frozenset(factor for factor, driver in drivers.items() if _is_person(driver))

    def soaks(self, factor: Factor) -> bool:
        """Whether a chamber or bath sets a hard factor, so that its temperatures are evidence."""
        return unit_of(factor.name) == TEMPERATURE_UNIT and factor.name not in self.by_hand

    @property
    def speed(self) -> float:
        """Bench seconds per real second."""
        live = self.bench.live if self.bench is not None else None
        return 1.0 if live is None else live.speed

    def unread(self) -> Iterator[str]:
        """Checks that are not possible, one sentence each."""
        if self.procedure is None:
            yield "this version of rig does not read its procedure: nothing was held against what that asks for"
        if self.bench is None:
            yield "this version of rig does not read its bench file: nothing was held against what that declares"


def _is_person(driver: str) -> bool:
    try:
        return issubclass(cast(type, driver_class(driver)), ByHand)
    except ConfigurationError:  # it is not installed here
        return False


def _procedure(documents: Mapping[str, str]) -> Procedure | None:
    try:
        return parse_procedure(documents["procedure.toml"], "procedure.toml", strict=False)
    except (ConfigurationError, KeyError):
        return None


def _bench(documents: Mapping[str, str]) -> BenchConfig | None:
    try:
        return bench_of_run(documents, "run file")
    except (ConfigurationError, KeyError):
        return None


class Rule(Protocol):
    """One group of checks; sees every record in order."""

    def look(self, record: Record, event: Event, fold: RunState) -> Iterator[str]:
        """Defects of a record: ends of sentences that begin with the record's name.

        Args:
            record: the record.
            event: its event.
            fold: state of the run before it.

        """
        ...
