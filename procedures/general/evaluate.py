"""Traces of tables of any kind, in JSON and in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from rig.fitter.errors import FitError
from rig.fitter.quantiles import t_limit
from rig.fitter.trace.outcome import Finding, Outcome, run_json
from rig.procedures.errors import DataError
from rig.procedures.evaluate.certificate import Change, Errors, certified, with_words
from rig.procedures.evaluate.results import Page
from rig.procedures.evaluate.trace_shown import in_full
from rig.procedures.general.column_roles import Roles, parts_played, read_roles, used_columns, with_response
from rig.procedures.general.trace import FoundTableEffect, TableTrace, trace_general
from rig.procedures.present.blocks import Block
from rig.procedures.present.numbers import interval_text
from rig.procedures.present.words import doubts_of, noise_of, part, verdict
from rig.procedures.tables.table import Reader, Table
from rig.procedures.tables.unused import TEXT, unit_after, unused_columns

IGNORED = "named with --ignore"
UNTESTED = "no effect of it could be tested: too few rows, or too large values"
"""Reason for a column that a person excluded."""


@dataclass(frozen=True, eq=False)
class GeneralTraced:
    """A table and its trace.

    Attributes:
        table: the table as read.
        roles: the user's declarations about columns.
        trace: the findings.
        taken: sentences about the roles of columns.
        parts: the roles of columns as JSON values.
    """

    table: Table
    roles: Roles
    trace: TableTrace
    taken: tuple[str, ...]
    parts: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        data = {"file": Path(self.table.source).name, "points": len(self.table), "kind": "general"}
        data |= {"simulated": self.table.simulated, **self.table.provenance}
        used = used_columns(self.roles, self.parts) - set(self._untested)
        unused = unused_columns(self.table, used, self._spared()).to_json()
        return run_json(data, [self.outcome], unused=unused)

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of the only response."""
        return (self.outcome,)

    def blocks(self) -> Iterator[Block]:
        """Blocks for people."""
        return in_full(self)

    def page(self) -> Page:
        """Its report."""
        from rig.procedures.general.report import page_of  # noqa: PLC0415 - plots take a second to import

        return page_of(self, {self.outcome.sensor: self.trace})

    @cached_property
    def outcome(self) -> Outcome:
        """Outcome of the response."""
        plain = self.trace.outcome()
        worded = (_worded(self.trace, effect, self._df(effect)) for effect in self.trace.effects)
        told = replace(
            plain, sensor=self.roles.label, findings=(*worded, *plain.unnamed), notes=(*self.taken, *plain.notes)
        )
        return certified(told, general_sentence(self.trace), _errors(self.trace), roles=self.parts)

    def _spared(self) -> dict[str, str]:
        """Reasons why free columns were not used."""
        reasons = {name: "does not vary" for name, v in self.table.columns.items() if np.ptp(v) == 0}
        reasons |= dict.fromkeys(self.table.text, TEXT)
        if self.roles.candidates is not None:
            reasons |= {n: "not among --candidates" for n in self.table.names if n not in self.roles.candidates}
        reasons |= dict.fromkeys(self._untested, UNTESTED)
        return reasons | dict.fromkeys(self.roles.ignore, IGNORED)

    @property
    def _untested(self) -> tuple[str, ...]:
        """Covariates that no candidate uses, as in a table of too few rows for any."""
        search = self.trace.search
        tested = {name for c in search.judge.candidates for name in c.effect.columns}
        return tuple(name for name in self.parts.get("covariates", ()) if name not in tested)

    def _df(self, effect: FoundTableEffect) -> float:
        """Degrees of freedom of an effect's standard errors: for effects constant in whole plots, at most by the number
        of whole plots.
        """
        own = float(self.trace.after.fit.df) if effect.df is None else effect.df
        sharing = self.roles.whole_plot or ((self.roles.replicate,) if self.roles.replicate else ())
        if effect.stratum != "whole-plot" or not sharing:
            return own
        every: dict[str, Any] = {**self.table.columns, **self.table.text}
        plots = set(zip(*(np.asarray(every[name]).tolist() for name in sharing), strict=True))
        return min(own, max(len(plots) - 1.0 - len(effect.coefficients), 1.0))


def _worded(found: TableTrace, effect: FoundTableEffect, df: float) -> Finding:
    """An effect or a finding about the noise with intervals and a sentence; `df` of its standard errors."""
    t = t_limit(0.95, df)
    halves = [t * error for error in effect.stderr]
    size, pairs = "", zip(effect.coefficients, effect.given, strict=effect.stratum != "noise")
    known = [(c, e) for c, e in pairs if np.isfinite(e) and e > 0]
    if known:  # for several columns as if they were orthogonal
        part, rms = t / float(np.sqrt(sum((c / e) ** 2 for c, e in known))), effect.rms
        about = "about " if len(known) > 1 else ""
        ends = rms * max(1.0 - part, 0.0), rms * (1.0 + part)
        size = f"{about}{interval_text(ends, rms * part)}{unit_after(found.response)} rms"
    return with_words(found.response, effect, halves, size)


def _errors(found: TableTrace) -> Errors:
    before, after, left_out = found.before, found.after, None
    if found.left_out and before.cv_rms is not None and after.cv_rms is not None:
        left_out = Change(f"the error at {found.left_out} left out of search and fit", before.cv_rms, after.cv_rms)
    of_one = Change("the standard error of one row", before.fit.sigma_E, after.fit.sigma_E)
    return Errors([of_one], left_out, floor="" if after.sigma_pure is None else f"{after.sigma_pure:.3g}")


def trace_general_table(read: Reader, roles: Roles, *, validate: bool = True) -> GeneralTraced:
    """Find effects missing in the declared model of any CSV table; without the left-out error, if not `validate`.

    Raises:
        DataError: a column is missing, the formula cannot be read, or there are too few rows for it.
    """
    roles = with_response(read, roles)
    table, data, taken = read_roles(read, roles)
    try:
        return GeneralTraced(table, roles, trace_general(data, validate=validate), taken, parts_played(data))
    except FitError as error:
        raise DataError(f"{table.source}: {error}") from error


def general_sentence(found: TableTrace) -> str:
    """Summary of the findings."""
    before, after = found.before.fit.sigma_E, found.after.fit.sigma_E
    start = f"{found.response}: the declared model ({found.declared}) leaves a standard error of {before:.4g}"
    noise = [effect.cause for effect in found.effects if effect.stratum == "noise"]
    more = "".join(f" What remains: {rest.cause}." for rest in found.unnamed)
    if not found.added:
        return f"{start}; {verdict(found.verdict, noise)}.{more}"
    effects = " and ".join(f"{e.effect} ({part(e.share)} of the error beyond scatter)" for e in found.added)
    text = f"{start}; it lacks {effects}. With that the standard error is {after:.4g}"
    if found.before.cv_rms is not None and found.after.cv_rms is not None:
        text += (
            f", and the error on {found.left_out} left out goes from {found.before.cv_rms:.4g} to "
            f"{found.after.cv_rms:.4g}"
        )
    alike = [f"{e.effect} from {' or '.join(e.aliases[:3])}" for e in found.added if e.aliases]
    if alike:
        text += f"; these data cannot tell {', nor '.join(alike)}"
    text += doubts_of({e.effect: e.doubtful for e in found.added})
    return f"{text}{noise_of(noise)}.{more}"
