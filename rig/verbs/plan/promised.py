"""Total uncertainty that a plan promises, by its register of equipment, and what more points would no longer buy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import special

from rig.fitter.budget import budgets
from rig.fitter.errors import FitError
from rig.procedures.errors import DataError
from rig.procedures.evaluate.influences import explain, influences
from rig.procedures.kinds import kind_of
from rig.register import DOCUMENT, KnownConditions, check_covered, check_surroundings, parse_register, stated_of
from rig.verbs.plan.foreseen import settled

if TYPE_CHECKING:
    from rig.procedures.evaluate.stated import Stated, Statements
    from rig.runs.plans import Plan

NORMAL = float(special.ndtri(0.975))
"""Coverage factor with infinite degrees of freedom, which more points approach."""
_MOST = 20_000
"""Points up to which a planned run is evaluated."""
NO_TOTAL = "no total uncertainty is predicted"
NO_METER = "errors of the outputs' meter are not in it: they need the sensors' sensitivity, [expect] in the procedure"


@dataclass(frozen=True)
class Promise:
    """One promised result.

    Attributes:
        name: of the result.
        unit: of its numbers.
        expanded: expanded uncertainty for 95 %.
        repeatability: the same by scatter alone.
        dominant: influence with the largest share.
        share: its share of the variance.
        limit: expanded uncertainty that no number of further points goes below, for one reading in use.
    """

    name: str
    unit: str
    expanded: float
    repeatability: float
    dominant: str
    share: float
    limit: float

    def to_json(self) -> dict[str, Any]:
        """JSON values."""
        return dict(vars(self))


@dataclass(frozen=True)
class Promised:
    """Total uncertainties of a plan.

    Attributes:
        results: promised results; () if there are none.
        notes: assumptions, or why there are none.
        lacking: what is not in them, though it should be.
    """

    results: tuple[Promise, ...]
    notes: tuple[str, ...]
    lacking: tuple[str, ...] = ()


def promised(plan: Plan, on: date) -> Promised:
    """Total uncertainties of inferred values, or else outputs, that a plan promises, if its run ends on a date.

    Raises:
        ConfigurationError: a certificate does not cover the settings of the plan, or does not hold at them.
    """
    if DOCUMENT not in plan.documents:
        return Promised((), (f"{NO_TOTAL}: the bench has no register of equipment (docs/how_to/register.md)",))
    if len(plan.run_list) > _MOST:
        return Promised((), (f"{NO_TOTAL} of more than {_MOST} points",))
    register = parse_register(plan.documents[DOCUMENT], DOCUMENT)
    stated, kind = stated_of(register, plan.bench, on), kind_of(plan.procedure)
    sensors = {f"{name}_{sensor.unit}": sensor.axis or "" for name, sensor in plan.bench.sensors.items()}
    set_to = {f.name: np.array(plan.run_list.column(f.name), np.float64) for f in plan.run_list.factors}
    check_covered(stated, set_to, DOCUMENT)
    check_surroundings(register, plan.bench, {**set_to, **settled(plan)}, KnownConditions(), DOCUMENT)
    try:
        expected = kind.expected(plan.procedure, plan.run_list, sensors)
        if not expected.meter:
            stated = replace(stated, errors=_without_outputs(stated.errors))
        evaluation = kind.evaluation(expected.table, kind.budget_options(), (), stated.constants)
        found = _of(evaluation, stated)
    except (DataError, FitError) as error:
        return Promised((), (f"{NO_TOTAL}: {error}",))
    unstated = [one for one in stated.unstated(evaluation.columns) if expected.meter or one not in sensors]
    notes = [f"total uncertainties by the register {register.name!r}, for {expected.assuming}"]
    notes += [] if expected.meter else [NO_METER]
    notes += ["the register has example values"] if register.example else []
    return Promised(found, tuple(notes), tuple(stated.what_is_lacking(unstated)))


def _without_outputs(errors: Sequence[Stated]) -> list[Stated]:
    """Errors without those of outputs' readings; a meter may read a reference standard, too."""
    computed = [replace(one, columns={n: one.columns[n] for n in one.computed}, reads=False) for one in errors]
    return [
        rest if one.reads else one for one, rest in zip(errors, computed, strict=True) if rest.columns or not one.reads
    ]


def _of(evaluation: Any, stated: Statements) -> tuple[Promise, ...]:
    explain(evaluation, stated)
    results = evaluation.results
    found = influences(evaluation, stated, same_meter=False)
    type_a = (results.type_a, *found.grouped)
    made = budgets(results.names, results.units, results.values, type_a, found.influences, forecast=True)
    own = np.sqrt(np.diag(results.type_a.covariance))
    inferred = [" inferred " in f" {one.name} " for one in made]
    known = {sensor for sensor, inverse in zip(results.sensors, inferred, strict=True) if inverse}
    promises = []
    numbers = zip(made, results.sensors, inferred, own.tolist(), results.of_fit.tolist(), strict=True)
    for one, sensor, inverse, scatter, of_fit in numbers:
        curve = " output " in f" {one.name} " and not known & {sensor, ""}
        if not (inverse or curve):  # outputs only where no reading determines a quantity
            continue
        first = max(one.contributions, key=lambda line: line.share)
        k, u = one.coverage_factor, one.standard_uncertainty
        limit = NORMAL * float(np.sqrt(max(u**2 - of_fit, 0.0)))
        promises.append(Promise(one.name, one.unit, k * u, k * scatter, first.name, first.share, limit))
    return tuple(promises)
