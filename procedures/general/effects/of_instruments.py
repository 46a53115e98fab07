"""Kinds of effects of instruments: what measuring does to the artefact, ranges, a reference's own curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.trace.engine.term import TableTerm
from rig.procedures.column_names import with_word
from rig.procedures.general.effects.columns import Terms, evenly, middle, rounded, searched, whole
from rig.procedures.general.effects.kind import TableKind
from rig.procedures.general.effects.quantities import is_quantity
from rig.procedures.general.effects.scene import TableScene, is_temperature

DECADES = 0.15
"""Settings spread over decades if their median size is below this share of the largest; on an even scale it is 0.5."""
FEWEST_SIZES, FEWEST_BESIDE_RANGE, BORDERS = 6, 3, 120
SMOOTH = 0.9
"""Share of a difference's variation that a cubic explains, if it is a curve and not scatter."""


def self_heating(scene: TableScene, name: str) -> Terms:
    """Square and cube of a current, alone and with their change with a temperature that is set.

    The power is I^2 R. The output is higher by its slope times the temperature rise: by I^2 of a resistance, by I^3 of
    a voltage.
    """
    c = scene.of(name)
    if not is_quantity(name, "current") or len(np.unique(np.abs(c))) < 3:
        return ()
    warm = [other for other in scene.settings if other != name and is_temperature(other)]
    found = []
    for order in (2, 3):
        text, column = f"{whole(name)}^{order}", c**order
        found.append(TableTerm((text,), column[:, None]))
        for other in warm:
            with_it = column * scene.of(other)
            found.append(TableTerm((text, f"{text} * {whole(other)}"), np.column_stack([column, with_it])))
    return found


def range_step(scene: TableScene, name: str) -> Terms:
    """One above a searched size of the setting."""
    v = scene.of(name)

    def at(k: float) -> TableTerm:
        k = rounded(k, k, 3)
        return TableTerm((f"(abs({name}) > {k:.15g})",), np.asarray(np.abs(v) > k, np.float64)[:, None])

    return searched(_borders(v), at, log=True)


def range_gain(scene: TableScene, name: str) -> Terms:
    """The setting above a searched size of it, else zero."""
    v = scene.of(name)

    def at(k: float) -> TableTerm:
        k = rounded(k, k, 3)
        return TableTerm((f"(abs({name}) > {k:.15g}) * {whole(name)}",), np.where(np.abs(v) > k, v, 0.0)[:, None])

    return searched(_borders(v), at, log=True)


def _borders(v: FloatArray) -> FloatArray:
    """Sizes between those of neighbouring settings, with a few rows on either side; none unless they span decades.

    Of very many, `BORDERS`: the place between two of these is refined.
    """
    size = np.abs(v)
    distinct = np.unique(size[size > 0.0])
    if len(distinct) < FEWEST_SIZES or np.median(distinct) > DECADES * distinct[-1]:
        return np.zeros(0)
    between = np.sqrt(distinct[:-1] * distinct[1:])
    below = np.searchsorted(np.sort(size), between)
    beside = np.minimum(below, len(size) - below)
    return evenly(between[beside >= FEWEST_BESIDE_RANGE], BORDERS)


def set_less_read(scene: TableScene, name: str) -> Terms:
    """Setpoint minus the reference's reading, if that is a curve over the setting."""
    if name not in scene.setpoints:
        return ()
    v = scene.of(name)
    difference = scene.setpoints[name] - v
    u = (v - middle(v)) / max(float(np.ptp(v)), np.finfo(float).tiny)
    if len(np.unique(np.round(u, 4))) < 5:
        return ()
    straight, curve = _left(difference, u, 1), _left(difference, u, 3)
    if float(straight @ straight) * (1.0 - SMOOTH) <= float(curve @ curve):
        return ()
    return (TableTerm((f"{with_word(name, 'set')} - {name}",), difference[:, None]),)


def _left(y: FloatArray, u: FloatArray, order: int) -> FloatArray:
    """(n,) residual of a polynomial."""
    columns = np.vander(u, order + 1)
    return np.asarray(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0])


SELF_HEATING = TableKind(
    "self-heating",
    "self-heating",
    "setting",
    "the current {0} heats the element it measures: {y} goes with the power",
    "point-by-replication",
    "{y} per power of {0}",
    "measure at two currents in a ratio of 1.4, which doubles the power, and extrapolate to none; or stir faster",
    "1 to 100 mK at 1 mA in 100 ohms",
    self_heating,
)
SELF_HEATING_OF_COVARIATE = replace(SELF_HEATING, of="covariate")

RANGE_STEP = TableKind(
    "range-step",
    "range",
    "setting",
    "above a certain {0} a further part, with an offset, is in the path: a range, a divider, an amplifier is switched",
    "between-point",
    "{y}",
    "fix the range, and measure one {0} near its end in both ranges that hold it",
    "a few digits of the higher range",
    range_step,
)

RANGE_GAIN = TableKind(
    "range-gain",
    "range",
    "setting",
    "the sensitivity to {0} is another one above a certain {0}: ranges have their own gains",
    "between-point",
    "{y} per unit of {0}",
    "fix the range, and measure one {0} near its end in both ranges that hold it",
    "10 to 100 ppm of reading",
    range_gain,
)

REFERENCE_NONLINEARITY = TableKind(
    "reference-nonlinearity",
    "nonlinearity",
    "setting",
    "{y} follows the setpoint of {0} and not the curve of the reference's reading: the reference is not straight",
    "between-point",
    "{y} per unit of {0}",
    "read {0} with another reference beside this one over the whole range",
    "the reference's uncertainty",
    set_less_read,
)
