"""Statements of conformity of a certificate, and tolerances that are none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from rig.bench.config import parse_toml, validated
from rig.errors import ConfigurationError
from rig.fitter.budget import Budgeted
from rig.fitter.decision import decide
from rig.fitter.errors import FitError
from rig.runs.plans import CONFORMITY
from rig.units.si import per_term
from rig.verbs.budget.evaluation import RunBudget
from rig.verbs.certificate.measured import Stage, Statement
from rig.verbs.certificate.parts_in_numbers import label_of, sensor_of
from rig.verbs.certificate.settings import CertificateSettings, ConformitySettings
from rig.verbs.certificate.tolerances import EVERY, ToleranceSettings

_ITS_POINT = "its value is the point by definition, whatever the item does, so every item would conform"


def statements(run: RunBudget, stage: Stage, settings: CertificateSettings) -> Iterator[Statement]:
    """Statements of conformity, one for each tolerance and result. Raises `FitError` if the rule cannot be applied."""
    for tolerance in settings.tolerance:
        if not list(_faults(run, tolerance)):  # each of which is a reason against the certificate
            for column, one, at in _judged(run, tolerance):
                yield _statement(one, column, at, run, stage, tolerance, settings)


def since_recorded(recorded: str | None, settings: CertificateSettings, at: str) -> Iterator[str]:
    """How tolerances and decision rule differ from those that the run recorded before its first observation, sentences.

    Args:
        recorded: text of the run's document; None if it has none.
        settings: of the laboratory.
        at: which run, in brackets; "" for the only one.
    """
    if recorded is None:
        if settings.tolerance:
            words = "nothing shows that they were agreed before it"
            yield f"Tolerances and decision rule are not recorded in the run{at}: {words}."
        return
    try:
        before = validated(ConformitySettings, parse_toml(recorded, CONFORMITY), CONFORMITY)
    except ConfigurationError as error:
        yield f"Tolerances and decision rule that the run{at} recorded beforehand cannot be read: {error}."
        return
    beforehand = f"recorded in the run{at} before its first observation"
    if before.decision != settings.decision:
        yield f"The decision rule is not the one {beforehand}: {before.decision.words}."
    for one in settings.tolerance:
        if one not in before.tolerance:
            yield f"The tolerance of {one.named} is not one {beforehand}."
    for one in before.tolerance:
        if one not in settings.tolerance:
            yield f"A tolerance of {one.named}, {beforehand}, is not applied: {one.stated}."


def without_result(run: RunBudget, settings: CertificateSettings, where: str) -> Iterator[str]:
    """Tolerances without a result, of one that is its point, in another unit, or without limits at a point.

    Args:
        run: with its budgets.
        settings: of the laboratory.
        where: name of their file.
    """
    for n, one in enumerate(settings.tolerance):
        yield from (f"tolerance of {one.named}: {fault} ({where}: tolerance.{n})" for fault in _faults(run, one))


def _faults(run: RunBudget, tolerance: ToleranceSettings) -> Iterator[str]:
    found = list(_judged(run, tolerance))
    if not found:
        sorts = dict.fromkeys(f"{EVERY}{label.partition(' ')[0]}" for label in _labels(run, given=True))
        yield f"no result has that label; there are: {'; '.join([*_labels(run), *sorts])}"
    elif any(_is_its_point(label_of(one, column, run)) for column, one, _ in found):
        yield f"{_ITS_POINT}; {_instead(label_of(found[0][1], found[0][0], run), run)}"
        return
    for _, budget, at in found:
        unit = per_term(budget.unit)
        if unit != tolerance.unit:
            yield f"unit = {tolerance.unit!r}, and {budget.name} is in {unit!r}: convert the limits"
        try:
            tolerance.permitted(at)
        except FitError as error:
            yield f"{budget.name}: {error}"


def _results(run: RunBudget) -> Iterator[tuple[str, Budgeted, Mapping[str, float]]]:
    """Column of its output, budget, and settings at the point of every result."""
    places = run.evaluation.results.at or ({},) * len(run.budgets)
    yield from zip(run.sensors, run.budgets, places, strict=True)


def _labels(run: RunBudget, *, given: bool = False) -> Iterable[str]:
    """Labels of results that may have a tolerance; where `given`, of those at points only."""
    every = {label_of(one, column, run): at for column, one, at in _results(run)}
    return [label for label, at in every.items() if not _is_its_point(label) and (at or not given)]


def _is_its_point(label: str) -> bool:
    """Whether the value of a result is the point at which it is given, whatever the item does."""
    return label.startswith("inferred ")


def _instead(label: str, run: RunBudget) -> str:
    """What has a tolerance in place of an inferred value: the outputs at its point."""
    place = f" {label[label.find('at ') :]}"
    ends = [one for one in _labels(run) if one.endswith(place)]
    named = " or ".join(map(repr, ends)) or "an output or a coefficient"
    return f"state the nominal output there, with its tolerance in the output's unit: result = {named}"


def _judged(run: RunBudget, tolerance: ToleranceSettings) -> Iterator[tuple[str, Budgeted, Mapping[str, float]]]:
    for column, one, at in _results(run):
        names = (sensor_of(column, run), column)
        if tolerance.applies_to(label_of(one, column, run)) and (not tolerance.sensor or tolerance.sensor in names):
            yield column, one, at


def _statement(
    one: Budgeted,
    column: str,
    at: Mapping[str, float],
    run: RunBudget,
    stage: Stage,
    tolerance: ToleranceSettings,
    settings: CertificateSettings,
) -> Statement:
    permitted = tolerance.permitted(at)
    made = decide(
        one.value,
        one.standard_uncertainty,
        permitted,
        settings.decision.made,
        expanded_uncertainty=one.expanded_uncertainty,
        df=one.df,
    )
    what = label_of(one, column, run)
    return Statement(
        sensor=sensor_of(column, run),
        what=what,
        tolerance=tolerance.text(at, per_term(one.unit)),
        rule=settings.decision.words,
        verdict=made.word,
        probability=_probability(made.conformity_probability),
        sentence=_SENTENCES[made.word].format(what),
        stage=stage,
        basis=tolerance.basis,
        permitted=(permitted.lower, permitted.upper),
    )


def _probability(value: float) -> str:
    """A probability with three digits, never rounded to certainty."""
    return "> 0.999" if value > 0.9995 else "< 0.001" if value < 0.0005 else f"{value:.3f}"


_SENTENCES = {
    "pass": "{} conforms with its tolerance.",
    "fail": "{} does not conform with its tolerance.",
    "conditionalPass": "{} is within its tolerance, but nearer to a limit than the guard band.",
    "conditionalFail": "{} is outside its tolerance, but nearer to a limit than the guard band.",
    "noPass": "conformity of {} is not stated; it is rather within its tolerance.",
    "noFail": "conformity of {} is not stated; it is rather outside its tolerance.",
}
