"""What a trace says of one sensor, whatever kind of run it was made in: one form to print, to plot and to hand on.

The judges of the kinds differ, because their statistics do. What they say has the same parts everywhere: a verdict,
findings, numbers before and after, coefficients, notes. JSON is made here and nowhere else; keys that a kind has for
itself stand in `more`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Literal, Self

from fitter.arrays import FloatArray
from fitter.json_values import JsonValue

Kind = Literal["effect", "noise", "unnamed"]


@dataclass(frozen=True)
class Row:
    """One value of a sensor, before the effects are taken out or after.

    Attributes:
        name: its key in JSON.
        value: None where it does not exist; a mapping where there is one for each of several settings.
        unit: of the value; "" for a plain number.
        limit: 95 % limit that the value is held against; None where it is no test.
        meaning: what it says, for a person.
        label: what a person calls it, with the unit it is shown in, and "{}" for the setting where there are several;
            "" for what stands in JSON alone.
        scale: the value times this is shown.
        digits: that are shown.
        where_known: no table shows it where it exists neither before nor after; else there is a dash.

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


OF_REPLICATIONS = ("sigma_E", "sigma_bias", "sigma_prec", "T_bias", "F_bias_95", "T_b", "T_S", "F_bS_95")
"""Keys that only a run with an analysis of variance over replications fills in."""


def absent(names: Iterable[str]) -> tuple[Row, ...]:
    """Rows of other kinds of runs: their keys are null in JSON, and no table shows them."""
    return tuple(Row(name) for name in names)


@dataclass(frozen=True)
class WithError:
    """A value with its error.

    Attributes:
        value: the estimate; None where there is none.
        stderr: its standard error; None where it is not known.
        df: degrees of freedom of the standard error; None where they are not told.
        interval_95: both ends; None where there is none.

    """

    value: float | None
    stderr: float | None
    df: float | None = None
    interval_95: tuple[float | None, float | None] | None = None

    @classmethod
    def of_json(cls, row: Any) -> Self:
        """From a row of a table of coefficients or parameters (`procedures.attitude.fit`)."""
        ends = row.get("interval95")
        return cls(row["estimate"], row["stderr"], row.get("df"), None if ends is None else (ends[0], ends[1]))


@dataclass(frozen=True)
class Parameter:
    """A coefficient or a parameter of the model.

    Attributes:
        name: its key in JSON.
        after: with the effects.
        before: with the declared model; None where only `after` is told.
        unit: of both; None where it is not told.
        label: what a person calls it; the name if "".
        digits: of the estimate that are shown.

    """

    name: str
    after: WithError
    before: WithError | None = None
    unit: str | None = None
    label: str = ""
    digits: int = 6

    def to_json(self) -> dict[str, JsonValue]:
        """After, with the keys that there are values for."""
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
    """What a finding looks like over the variable that it is of, as data.

    Attributes:
        x: (n,) the variable.
        label: of the variable, with its unit.
        left: (n,) residual with all that was found.
        adds: (n,) what the finding adds beyond what the declared model takes up; None for a finding about the noise.
        unit: of `left` and `adds`.

    """

    x: FloatArray
    label: str
    left: FloatArray
    adds: FloatArray | None
    unit: str


@dataclass(frozen=True, eq=False)
class Finding:
    """An effect, a finding about the noise, or what remains without a name.

    Attributes:
        kind: which of the three.
        cause: what happens physically; where it lives, for what has no name.
        stratum: where it was found.
        share: of the sensor's whole error beyond scatter, how much it explains.
        effect: name in the catalogue; "" for what has none.
        terms: as formulas.
        coefficients: of the terms.
        stderr: of the coefficients, conditional on the selection; not finite where there is none.
        unit: of the coefficients, or one each with commas between.
        size: in physical terms.
        p_adjusted: family-wise probability of finding the like by chance; None for what has no name.
        p_adjusted_is_bound: the probability is at most this.
        aliases: other effects that the data cannot tell from it.
        separation: standard errors by which every other explanation falls behind, by effect.
        separate_by: the measurement that would tell it from its aliases, or confirm it.
        doubtful: why its name should not be believed yet, one sentence; None where nothing speaks against it.
        added: a smooth term without a cause was added for what has no name.
        interval_95: of each coefficient, None for one that has none; None as long as nobody worked them out.
        size_95: 95 % interval of the size in words; None where there is none.
        sentence: about it, that stands alone; "" as long as it is not worded.
        more: keys of JSON that only one kind of run has.

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
    more: Mapping[str, JsonValue] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """As `rig trace --json` prints it."""
        if self.kind == "unnamed":
            told = {"where": self.cause, "share": self.share, "added": self.added, "stratum": self.stratum}
            return {**told, **self.more}
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
            **self.more,
        }
        if self.interval_95 is not None:
            table["interval_95"] = [None if pair is None else list(pair) for pair in self.interval_95]
            table |= {"size_95": self.size_95, "sentence": self.sentence}
        return table


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a trace says of one sensor.

    Attributes:
        sensor: column name of its output.
        declared: the declared model.
        verdict: "explained", "nothing to add", "partly explained" or "unexplained".
        findings: effects, largest share first, then findings about the noise, then what remains without a name.
        before: rows with the declared model.
        after: the same rows with the effects taken out.
        fitted: coefficients of the declared model and of the effects, fitted together.
        notes: sentences that stand beside the numbers.
        refused: causes that would fit but for their sign or size, as JSON has them; None where none is ever refused.
        parameters: of the calibration, for people; () where they are the coefficients.
        sentence: what was found, in brief; "" as long as it is not worded.
        certificate: the paragraph for a certificate; "" as long as it is not worded.
        figures: what each effect and finding about the noise looks like, by its name.
        more: keys of JSON that only one kind of run has.

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
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def named(self) -> tuple[Finding, ...]:
        """Effects and findings about the noise."""
        return tuple(one for one in self.findings if one.kind != "unnamed")

    @property
    def unnamed(self) -> tuple[Finding, ...]:
        """What remains without a name."""
        return tuple(one for one in self.findings if one.kind == "unnamed")

    def to_json(self) -> dict[str, Any]:
        """As `rig trace --json` prints it; numbers that do not exist are None."""
        table: dict[str, Any] = {
            "declared": self.declared,
            "verdict": self.verdict,
            "before": {row.name: row.value for row in self.before},
            "effects": [one.to_json() for one in self.named],
            "after": {row.name: row.value for row in self.after},
            "unnamed": [one.to_json() for one in self.unnamed],
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
        data: file, points and kind, and what is known of the run.
        outcomes: one a sensor.
        more: keys beside "data" and "sensors".

    """
    return {"data": dict(data), **more, "sensors": {one.sensor: one.to_json() for one in outcomes}}
