"""Parts of a certificate that are numbers: results, budgets, statements of conformity, conditions, effects."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from rig.fitter.budget import Budgeted
from rig.fitter.confirm import BY_BOTH, Confirmation
from rig.fitter.rounding import rounded, rounded_df, rounded_factor, rounded_to, rounded_uncertainty
from rig.fitter.trace.outcome import Finding, Outcome
from rig.procedures.column_names import stem_of, unit_of
from rig.procedures.present.joined import joined, once
from rig.procedures.present.terms import in_words
from rig.procedures.present.words import constants_of
from rig.register import holds_of
from rig.register.surroundings import shown_unit
from rig.units.si import per_term
from rig.verbs.budget.evaluation import RunBudget
from rig.verbs.budget.found import IGNORED, Found
from rig.verbs.budget.lacking import in_state
from rig.verbs.certificate import standing_sentences as words
from rig.verbs.certificate.document import Condition, Holding
from rig.verbs.certificate.measured import Budget, Contribution, Effect, Result, ResultTable, Stage
from rig.verbs.certificate.typeset import raised
from rig.verbs.confirm import Confirmed, ends

SMALL = 1e-3
"""Share of the variance below which an influence is not listed."""
ABSORBED = " Under their table stands which of them have absorbed a part of the effects."
_SHARED = "Quantities inferred from all items together"
_OF_TEMPERATURES = -2
"""Last printed place of recorded conditions: that of meters of temperatures, and of tables."""


def sensor_of(name: str, run: RunBudget) -> str:
    """Name of a sensor on the bench, from the column of its output; other names are unchanged."""
    return run.of.table.outputs.get(name, name)


def label_of(one: Budgeted, column: str, run: RunBudget) -> str:
    """Name of a result without that of its sensor."""
    for name in (column, sensor_of(column, run)):
        if name and one.name.startswith(f"{name} "):
            return one.name.removeprefix(name).strip()
    return one.name


def _result(one: Budgeted, column: str, run: RunBudget) -> Result:
    both = rounded(one.value, one.expanded_uncertainty)
    power = f"e{both.exponent:+03d}" if both.exponent else ""
    return Result(
        name=one.name,
        label=in_words(label_of(one, column, run)),
        at=(),
        value=f"{both.value_text}{power}",
        expanded=f"{both.uncertainty_text}{power}",
        k=rounded_factor(one.coverage_factor),
        probability=f"{one.coverage_probability:g}",
        unit=per_term(one.unit),
        estimate=one.value,
        standard=one.standard_uncertainty,
        factor=one.coverage_factor,
        df=one.df,
    )


def _of_sensors(run: RunBudget) -> Iterator[tuple[str, list[Budgeted]]]:
    """Budgets by the output's column of their sensor; those of all sensors together last, with ""."""
    pairs = list(zip(run.sensors, run.budgets, strict=True))
    for column in sorted(dict.fromkeys(run.sensors), key=lambda name: not name):
        yield column, [one for sensor, one in pairs if sensor == column]


def tables(run: RunBudget, stage: Stage) -> tuple[ResultTable, ...]:
    """A table of results for each sensor, and one for what is inferred from all of them."""
    found = []
    for column, ones in _of_sensors(run):
        title = "results" if column else _SHARED
        results = tuple(_result(one, column, run) for one in ones)
        described = run.evaluation.described(column) if column else ""
        away = run.lacking[column].away if column in run.lacking else ""
        told = [*([f"{described}."] if described else []), *([away] if away else [])]
        told += [
            f"{label[:1].upper()}{label[1:]} {run.absorbed[one.name]}."
            for one in ones
            if one.name in run.absorbed
            for label in [in_words(label_of(one, column, run))]
        ]
        found.append(ResultTable(sensor_of(column, run), title, results, (), stage, tuple(told)))
    return tuple(found)


def notes(run: RunBudget, confirmed: Confirmed | None = None, ignored: Sequence[str] = ()) -> Iterator[str]:
    """Notes on the uncertainties, as sentences; `confirmed` has the results of further runs, and the trace `ignored`
    these columns.
    """
    if ignored:
        told = IGNORED.format(columns=", ".join(ignored))
        yield f"{told[0].upper()}{told[1:]}."
    pairs = sorted(zip(run.sensors, run.budgets, strict=True), key=lambda pair: -len(pair[1].name))
    for note in filter(None, (_with_further_runs(one, confirmed) for one in once(run.notes, run.of.table.outputs))):
        first = note.partition(" ")[0]
        told = f"{note[0].upper()}{note[1:]}" if first.isalpha() else note
        for column, one in pairs:  # as the tables call them
            told = told.replace(one.name, f"{sensor_of(column, run)} {label_of(one, column, run)}") if column else told
        yield told if told.endswith(".") else f"{told}."


_DOUBT, _APART, _OPEN = "it is doubtful", "these data cannot separate", "the data of this run alone cannot separate"


def _with_further_runs(note: str, confirmed: Confirmed | None) -> str:
    """A note about the data of the run, with the results of further runs for the effect that it names.

    "" for no more than a doubt that these settled: the table of effects has their verdict.
    """
    answers = [] if confirmed is None else confirmed.answers
    about = note[: min((note.index(said) for said in (_DOUBT, _APART) if said in note), default=0)]
    settled = [one for one in answers if one.verdict == "confirmed" and _names(one.effect, about)]
    if not settled:
        return note
    if _APART not in note:
        return ""
    note = f"{about}{note[note.index(_APART) :].replace(_APART, _OPEN)}"
    for one in settled:
        excluded = [name for name in _excluded(one) if _names(name, note)]
        does = f"excludes {', '.join(excluded)}" if excluded else "confirms the name"
        note += f"; the further run {does}, and the budgets count the difference all the same"
    return note


def _names(effect: str, note: str) -> bool:
    """Whether a note names an effect, and not only one whose name begins or ends like it."""
    return re.search(rf"(?<!\S){re.escape(effect)}(?=[:;,.]?(\s|$))", note) is not None


def _excluded(answer: Confirmation) -> list[str]:
    """Other causes that further runs exclude."""
    return [one.effect for one in answer.members if not one.holds]


def budgets(run: RunBudget, stage: Stage, which: str) -> tuple[Budget, ...]:
    """Budgets of the annex: none, all, or of every sort of result the one of the largest uncertainty."""
    found: list[Budget] = []
    for column, ones in _of_sensors(run):
        chosen = ones if which == "all" else _largest(ones, column, run) if which == "largest" else ()
        found.extend(_budget(one, column, run, stage) for one in chosen)
    return tuple(found)


def _largest(ones: Sequence[Budgeted], column: str, run: RunBudget) -> Iterator[Budgeted]:
    """Of results whose labels begin alike, such as all outputs, and that are in the unit of the first one."""
    sorts: dict[str, list[Budgeted]] = {}
    for one in ones:
        sorts.setdefault(label_of(one, column, run).partition(" ")[0], []).append(one)
    for alike in sorts.values():
        same = (one for one in alike if one.unit == alike[0].unit)
        yield max(same, key=lambda one: one.expanded_uncertainty)


def _budget(one: Budgeted, column: str, run: RunBudget, stage: Stage) -> Budget:
    by_share = sorted(one.contributions, key=lambda line: -abs(line.share))
    listed = [line for line in by_share if abs(line.share) >= SMALL]
    lines = tuple(
        Contribution(
            line.name, line.source, line.kind, _uncertainty(line.standard_uncertainty), rounded_df(line.df), line.share
        )
        for line in listed
    )
    result = _result(one, column, run)
    return Budget(
        sensor=sensor_of(column, run),
        result=one.name,
        label=result.label,
        unit=result.unit,
        contributions=lines,
        combined=_uncertainty(one.standard_uncertainty),
        df=rounded_df(one.df),
        k=result.k,
        expanded=result.expanded,
        stage=stage,
        left=len(by_share) - len(listed),
    )


def _uncertainty(value: float) -> str:
    return decimal_text(rounded_uncertainty(value)) if value else "0"


def decimal_text(number: Decimal) -> str:
    """A rounded number with all of its digits and no others, with a power of ten if it needs one."""
    exponent = number.as_tuple().exponent
    assert isinstance(exponent, int)
    if -9 <= exponent <= 0:
        return f"{number:f}"
    power = number.adjusted()
    return f"{number.scaleb(-power):f}e{power:+03d}"


def repeatability_only(run: RunBudget) -> str:
    """Results whose uncertainty has nothing but the scatter of the run, in words; "" if there is none."""
    of: dict[str, list[str]] = {}
    for one, sensor in zip(run.budgets, run.sensors, strict=True):
        if not any(line.kind == "B" for line in one.contributions):
            of.setdefault(run.of.table.outputs.get(sensor, sensor), []).append(one.name)
    every = [name for names in of.values() for name in names]
    if len(every) < 2:
        return "".join(f"{name}: its uncertainty is repeatability only" for name in every)
    alike: dict[tuple[str, ...], list[str]] = {}
    for sensor, names in of.items():
        alike.setdefault(tuple(one.removeprefix(f"{sensor} ") for one in names), []).append(sensor)
    said = (f"{', '.join(names)}{f' of {whose}' if (whose := ', '.join(of)) else ''}" for names, of in alike.items())
    return f"the uncertainties of {len(every)} results are repeatability only ({'; '.join(said)})"


def conditions(run: RunBudget, stage: Stage) -> Iterator[Condition]:
    """Temperatures and what else of the room was recorded with the observations, or is stated by the laboratory. A
    temperature that was set is one, if the model of a result does not have it.
    """
    of = run.of
    used = {name for name in run.evaluation.columns if not run.evaluation.lack(name)}
    varied = [one for one in of.table.factors if unit_of(one) == "degC" and one not in used]
    for name in dict.fromkeys((*of.config.temperatures, *varied)):
        values = of.table.columns.get(name)
        if values is not None and np.isfinite(values).all():
            low, mean, high = (_recorded(value) for value in (values.min(), values.mean(), values.max()))
            yield Condition(name, _label(name), shown_unit(name), low, mean, high, stage)
    for name, (least, most) in of.told.stated.items():
        yield Condition("", _label(name), shown_unit(name), f"{least:g}", "", f"{most:g}", stage)


def _label(name: str) -> str:
    return stem_of(name).replace("_", " ")


def _recorded(value: float) -> str:
    return f"{rounded_to(float(value), _OF_TEMPERATURES):f}"


def holdings(run: RunBudget, stage: Stage) -> Iterator[Holding]:
    """Conditions under which the certificates of the equipment hold, with all that is known of each."""
    of = run.of
    for one in holds_of(of.register, of.config):
        about = (one.asset, one.certificate, one.label, shown_unit(one.quantity), f"{one.low:g} to {one.high:g}")
        sources = one.sources(of.config, of.table.columns, of.told)
        for name, values in sources.items():
            ends = float(np.nanmin(values)), float(np.nanmax(values))
            by_run = name in of.table.columns
            low, high = (_recorded(end) if by_run else f"{end:g}" for end in ends)
            lost = int(np.sum(~np.isfinite(values)))
            missing = f", missing in {words.count(lost, 'observation')}" if lost else ""
            yield Holding(*about, f"{low} to {high}", f"{_label(name) if by_run else name}{missing}", stage)
        if not sources:
            yield Holding(*about, "", "", stage)


def effects(
    run: RunBudget, outcomes: Iterable[Outcome], confirmed: Confirmed | None, stage: Stage, heads: Mapping[Path, str]
) -> Iterator[Effect]:
    """Effects that a trace found, and what further runs say of them; remainders without a name, too.

    An effect that further runs distinguish from the one named stands there with its own name and size.

    Args:
        run: with its budgets.
        outcomes: of the trace.
        confirmed: results of the further runs; None if none was made.
        stage: of the run.
        heads: head hash of each further run.
    """
    answers = {} if confirmed is None else {one.effect: one for one in confirmed.answers}
    files = [] if confirmed is None else [f"{path.name}, head {heads[path][:16]}" for path in confirmed.paths]
    by = f" by {' and '.join(files)}"
    for outcome in outcomes:
        sensor = sensor_of(outcome.sensor, run)
        for one in outcome.findings:
            if one.kind == "unnamed":
                size = f"{100 * one.share:.2g} % of the error beyond scatter"
                yield Effect(sensor, "no name", one.cause, size, False, "no cause of the catalogue explains it", stage)
                continue
            answer = answers.get(one.effect)
            confirms = answer is not None and answer.verdict == "confirmed"
            word = "" if answer is None or confirms else answer.verdict
            unasked = "no further run was made" if confirmed is None else "the further run was not judged by it"
            how = f"{word}{by}".strip() if answer is not None else unasked
            if answer is not None and confirms and (excluded := [n for n in _excluded(answer) if n in one.aliases]):
                how += f", which excludes {', '.join(excluded)}"
            if answer is not None and answer.verdict == "replaced":
                found, cause = answer.members[0], f"what the trace of the run named {one.effect}"
                size = found.sizes.get(outcome.sensor, "size not determined")
                yield Effect(sensor, found.effect, cause, size, True, f"distinguished from {one.effect}{by}", stage)
                continue
            size = "; ".join((one.size + (f" ({one.size_95})" if one.size_95 else ""), *constants_of(one.own_keys)))
            if answer is not None and confirms:
                for mine in (m for m in answer.members if m.effect == one.effect):
                    told = mine.sizes.get(outcome.sensor, "")
                    if mine.zero:  # that run has few rows, and alone may leave the size open
                        size += f"; by both runs {ends(mine, outcome.sensor).replace(f' ({outcome.sensor})', '')}"
                    elif told:
                        of_both = told.removesuffix(BY_BOTH)
                        which = "the further run" if len(files) < 2 else "the further runs"
                        size += f"; by {which if of_both == told else 'both runs'} {of_both}"
            cause = one.cause.partition(": ")[0].partition("; ")[0].replace(outcome.sensor, "the output")
            yield Effect(sensor, one.effect, cause, size, confirms, how, stage, one.shared or "")


def doubtful(outcomes: Iterable[Outcome], confirmed: Confirmed | None) -> Iterator[tuple[str, Finding]]:
    """Sensor and finding of every name that is doubtful, and that no further run has confirmed or replaced."""
    settled: Mapping[str, str] = {} if confirmed is None else {one.effect: one.verdict for one in confirmed.answers}
    for outcome in outcomes:
        for one in outcome.named:
            if one.doubtful and settled.get(one.effect) not in ("confirmed", "replaced"):
                yield outcome.sensor, one


def models(run: RunBudget, stage: Stage, found: Found) -> Iterator[str]:
    """The model of the results, where a trace found effects beside the declared one, sentences."""
    if not any(found.effects.values()):
        return
    of = f"Run {stage}: results" if stage else "Results"
    settled = {} if found.confirmed is None else {a.effect: a.holding[0] for a in found.confirmed.answers if a.holding}
    inside, outside = [], []
    for output, names in found.effects.items():
        lacks = run.lacks.get(output, ())
        states = run.lacking[output].states if output in run.lacking else {}
        has = [settled.get(name, name) for name in names if name not in lacks]
        inside += [(sensor_of(output, run), in_state(has, states))] if has else []
        told = {name: f"{name}, {found.verdicts[name]}" if name in found.verdicts else name for name in lacks}
        named = in_state(list(told.values()), {told[name]: state for name, state in states.items() if name in told})
        outside += [(sensor_of(output, run), named)] if told else []
    with_ = f" with the effects that were found ({'; '.join(joined(inside))})" if inside else ""
    by, held = f"the declared model{with_}", any(one.states for one in run.lacking.values())
    if not outside:
        yield f"{of}, budgets and statements of conformity are of {by}.{f' {words.STATES}' if held else ''}"
        return
    yield (
        f"{of} are of {by}, {words.LACKS} that were found ({'; '.join(joined(outside))}). {words.STATES} A budget has "
        f"a line for each result that they move, and conformity counts it: the difference from the model with these "
        f"effects, in these states and conditions."
    )
    if moved := [one for one in run.undeclared if not {"output", "inferred"} & set(one.split())]:
        yield (
            f"{', '.join(map(raised, moved))}: coefficients of the declared model over the range of this run, and no "
            f"properties of the item.{ABSORBED * any(one in run.absorbed for one in moved)}"
        )
