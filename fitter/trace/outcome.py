"""Result of a trace for one sensor of any kind of run: one form to print, to plot and to export.

The judges of the kinds differ, because their statistics differ. Their results have the same parts: a verdict, findings,
numbers before and after, coefficients, notes. JSON is made only here; keys of one kind are in `more`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Literal, Self

from rig.fitter.arrays import FloatArray
from rig.fitter.json_values import JsonValue
from rig.fitter.trace.shape import Shape

Kind = Literal["effect", "noise", "unnamed"]
CONDITIONAL = "standard errors of the effects are conditional on their having been selected on these data"
LEFT_OUT = "left-out error: "
"""Begin of the note that says how it was made."""
UNSIGNED = (
    "no sign and no largest size is asked of an effect in tables of any kind: whether the named cause can be as large, "
    "and have that sign, is for the reader to judge"
)
OF_METHOD = (CONDITIONAL, LEFT_OUT, UNSIGNED)
"""Notes about the method, or their begins: the same for every run of a kind."""


@dataclass(frozen=True)
class Row:
    """One value of a sensor, before and after the effects are removed.

    Attributes:
        name: its key in JSON.
        value: None if it does not exist; a mapping if there is one for each of several settings.
        unit: of the value; "" for a plain number.
        limit: 95 % limit of the value; None if it is not a test.
        meaning: explanation for a person.
        label: name for a person, with the displayed unit, and "{}" for the setting if there are several; "" for values
            in JSON only.
        scale: factor for display.
        digits: displayed digits.
        where_known: whether tables omit it if it exists neither before nor after; otherwise they show a dash.
        in_reports: whether only reports show it.
    """

    name: str
    value: JsonValue = None
    unit: str = ""
    limit: float | None = None
    meaning: str = ""
    label: str = ""
    scale: float = 1.0
    digits: int = 3
    where_known: bool = False
    in_reports: bool = False


OF_REPLICATIONS = ("sigma_E", "sigma_bias", "sigma_prec", "T_bias", "F_bias_95", "T_b", "T_S", "F_bS_95")
"""Keys for runs with an analysis of variance over replications only."""


def absent(names: Iterable[str]) -> tuple[Row, ...]:
    """Rows of other kinds of runs: their keys are null in JSON, and tables omit them."""
    return tuple(Row(name) for name in names)


@dataclass(frozen=True)
class WithError:
    """A value with its error.

    Attributes:
        value: the estimate; None if there is none.
        stderr: its standard error; None if unknown.
        df: degrees of freedom of the standard error; None if not given.
        interval_95: both ends; None if there is none.
    """

    value: float | None
    stderr: float | None
    df: float | None = None
    interval_95: tuple[float | None, float | None] | None = None

    @classmethod
    def of_json(cls, row: Any) -> Self:
        """From a row of a table of coefficients or parameters (`rig.procedures.attitude.fit`)."""
        ends = row.get("interval95")
        return cls(row["estimate"], row["stderr"], row.get("df"), None if ends is None else (ends[0], ends[1]))


@dataclass(frozen=True)
class Parameter:
    """A coefficient or a parameter of the model.

    Attributes:
        name: its key in JSON.
        after: with the effects.
        before: with the declared model; None if only `after` is given.
        unit: of both; None if not given.
        label: name for a person; the key if "".
        digits: displayed digits of the estimate.
    """

    name: str
    after: WithError
    before: WithError | None = None
    unit: str | None = None
    label: str = ""
    digits: int = 6

    def to_json(self) -> dict[str, JsonValue]:
        """After the effects, with the keys of existing values."""
        one = self.after
        table: dict[str, JsonValue] = {"estimate": one.value, "stderr": one.stderr}
        if one.df is not None:
            table["df"] = one.df
        if one.interval_95 is not None:
            table["interval95"] = list(one.interval_95)
        if self.unit is not None:
            table["unit"] = self.unit
        return table


@dataclass(frozen=True, eq=False)
class Figure:
    """Data for a plot of a finding over its variable.

    Attributes:
        x: (n,) the variable.
        label: of the variable, with its unit.
        left: (n,) residual with all findings.
        adds: (n,) contribution of the finding beyond the part absorbed by the declared model; None for a finding about
            the noise.
        unit: of `left` and `adds`.
    """

    x: FloatArray
    label: str
    left: FloatArray
    adds: FloatArray | None
    unit: str


@dataclass(frozen=True, eq=False)
class Finding:
    """An effect, a finding about the noise, or the remainder without a name.

    Attributes:
        kind: one of the three.
        cause: the physical mechanism; for the remainder its place.
        stratum: where it was found; of a remainder "noise" if it is a random walk, otherwise "unnamed".
        share: its share of the sensor's whole error beyond scatter; of all together at most one
            (`rig.fitter.trace.shares`).
        effect: name in the catalogue; "" for the remainder.
        terms: as formulas, without those that have no effect on this sensor.
        coefficients: of the terms.
        stderr: of the coefficients, conditional on the selection; () or not finite if there is none.
        unit: of the coefficients, or one for each, separated by commas.
        size: of the cause, in physical terms: "1.50e-3 deg/g", "45 ppm/degC", "1.2 arcsec".
        p_adjusted: probability of such a finding by chance, over all candidates, sensors and steps of the run.
        p_adjusted_is_bound: the probability is only known to be at most this, by the number of simulations.
        aliases: other effects that the data cannot distinguish from it.
        separation: standard errors by which every other explanation is worse, by effect.
        separate_by: the measurement that would separate it from its aliases, or confirm it.
        doubtful: reason to doubt its name, one sentence; None if there is none.
        added: whether a smooth term without a cause was added for the remainder.
        interval_95: of each coefficient, None for one without; None before they are computed.
        size_95: 95 % interval of the size in words; None if there is none.
        sentence: a self-contained sentence about it; "" before it is written.
        shape: of a remainder without a name, as a curve or a surface; None for others, and where it has none.
        shared: that all sensors of the run have it alike, and what would tell them from what they share, sentences; ""
            if they have not.
        against: variable of the data for a plot.
        left_in: whether the numbers after leave it in the output, because the error would be larger without it.
        more: keys of JSON of one kind of run only.
    """

    kind: Kind
    cause: str
    stratum: str
    share: float
    effect: str = ""
    terms: tuple[str, ...] = ()
    coefficients: tuple[float, ...] = ()
    stderr: tuple[float, ...] = ()
    unit: str = ""
    size: str = ""
    p_adjusted: float | None = None
    p_adjusted_is_bound: bool = False
    aliases: tuple[str, ...] = ()
    separation: Mapping[str, float] = field(default_factory=dict)
    separate_by: str = ""
    doubtful: str | None = None
    added: bool = False
    interval_95: tuple[tuple[float, float] | None, ...] | None = None
    size_95: str | None = None
    sentence: str = ""
    shape: Shape | None = None
    shared: str = ""
    against: str = ""
    left_in: bool = False
    more: Mapping[str, JsonValue] = field(default_factory=dict)

    @classmethod
    def of_noise(cls, *, p: float, coefficients: tuple[float, ...], **told: Any) -> Self:
        """A finding about the noise: no column of the model, so no share or standard errors; `told` are attributes."""
        told = {"stderr": (float("nan"),) * len(coefficients), "p_adjusted": p, **told}
        return cls(kind="noise", stratum="noise", share=0.0, coefficients=coefficients, **told)

    @property
    def own_keys(self) -> Mapping[str, JsonValue]:
        """Keys of JSON of one kind of run only."""
        return self.more

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its coefficients as rows after those of the declared model, where it is taken out."""
        if self.left_in:
            return ()
        rows = zip(self.terms, self.coefficients, self.stderr, strict=True)
        named = ((f"{self.effect}: {term}", WithError(value, error)) for term, value, error in rows)
        return tuple(Parameter(name, estimate, unit=self.unit) for name, estimate in named)

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        if self.kind == "unnamed":
            told = {"where": self.cause, "share": self.share, "added": self.added, "stratum": self.stratum}
            return {**told, **self.own_keys, "shape": None if self.shape is None else self.shape.to_json()}
        table: dict[str, Any] = {
            "effect": self.effect,
            "cause": self.cause,
            "stratum": self.stratum,
            "term": ", ".join(self.terms),
            "terms": list(self.terms),
            "coefficients": list(self.coefficients),
            "stderr": [error if isfinite(error) else None for error in self.stderr],
            "unit": self.unit,
            "size": self.size,
            "p_adjusted": self.p_adjusted,
            "p_adjusted_is_bound": self.p_adjusted_is_bound,
            "share": self.share,
            "aliases": list(self.aliases),
            "separation_sigmas": dict(self.separation),
            "doubtful": self.doubtful,
            "separate_by": self.separate_by,
            **self.own_keys,
        }
        if self.interval_95 is not None:
            table["interval_95"] = [None if pair is None else list(pair) for pair in self.interval_95]
            table |= {"size_95": self.size_95, "sentence": self.sentence}
        return table


def remains(where: str, share: float, *, stratum: str = "unnamed", **more: Any) -> Finding:
    """The remainder that no effect of the catalogue explains: its place, and its share; `more` are attributes."""
    return Finding("unnamed", where, stratum, share, **more)


@dataclass(frozen=True, eq=False)
class Instead:
    """One shape without a name in place of all effects whose names are doubtful.

    Attributes:
        effects: their names.
        where: its place, in words.
        shape: it, beside the effects that are not doubtful.
    """

    effects: tuple[str, ...]
    where: str
    shape: Shape

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`."""
        return {"effects": list(self.effects), "where": self.where, "shape": self.shape.to_json()}


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a trace for one sensor.

    Attributes:
        sensor: column name of its output.
        declared: the declared model.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained".
        findings: effects, largest share first, then findings about the noise, then the remainder.
        before: rows with the declared model.
        after: the same rows with the effects removed.
        fitted: coefficients of the declared model and of the effects, fitted together.
        notes: sentences shown with the numbers.
        refused: causes that would fit except for their sign or size, as JSON values; None for kinds without refusals.
        parameters: of the calibration, for people; () where they are the coefficients.
        sentence: summary of the findings; "" before it is written.
        certificate: the paragraph for a certificate; "" before it is written.
        figures: plot data of each effect and finding about the noise, by its name.
        instead: one shape without a name in place of the doubtful effects; None where none is.
        more: keys of JSON of one kind of run only.
    """

    sensor: str
    declared: str
    verdict: str
    findings: tuple[Finding, ...]
    before: tuple[Row, ...]
    after: tuple[Row, ...]
    fitted: tuple[Parameter, ...]
    notes: tuple[str, ...]
    refused: tuple[Mapping[str, Any], ...] | None = None
    parameters: tuple[Parameter, ...] = ()
    sentence: str = ""
    certificate: str = ""
    figures: Mapping[str, Figure] = field(default_factory=dict)
    instead: Instead | None = None
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def named(self) -> tuple[Finding, ...]:
        """Effects and findings about the noise."""
        return tuple(one for one in self.findings if one.kind != "unnamed")

    @property
    def unnamed(self) -> tuple[Finding, ...]:
        """The remainder without a name."""
        return tuple(one for one in self.findings if one.kind == "unnamed")

    def to_json(self) -> dict[str, Any]:
        """JSON values for `rig trace --json`; missing numbers are None."""
        table: dict[str, Any] = {
            "declared": self.declared,
            "verdict": self.verdict,
            "before": {row.name: row.value for row in self.before},
            "effects": [one.to_json() for one in self.named],
            "after": {row.name: row.value for row in self.after},
            "unnamed": [one.to_json() for one in self.unnamed],
            "instead": None if self.instead is None else self.instead.to_json(),
            "notes": list(self.notes),
        }
        if self.refused is not None:
            table["refused"] = [dict(one) for one in self.refused]
        table["fitted"] = {"coefficients": {one.name: one.to_json() for one in self.fitted}}
        if self.sentence:
            table |= {"sentence": self.sentence, "certificate": self.certificate}
        return {**table, **self.more}


def run_json(data: Mapping[str, Any], outcomes: Iterable[Outcome], **more: Any) -> dict[str, Any]:
    """The object `rig trace --json` prints.

    Args:
        data: file, points and kind, and provenance of the run.
        outcomes: one per sensor.
        more: keys beside "data" and "sensors".
    """
    return {"data": dict(data), **more, "sensors": {one.sensor: one.to_json() for one in outcomes}}
