"""Nights and tables with something hidden, or nothing, made ready for every method of `bench_trace_peers`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from proving.truth.attitude import D1, told_the_truth
from proving.truth.attitude import simulate as simulate_night
from proving.truth.attitude_hidden import CLEAN, HIDDEN, sized, together
from proving.truth.table import MISSING, Lab, options
from proving.truth.table import simulate as simulate_table
from rig.fitter.linear import orthonormal
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.trace import trace
from rig.procedures.attitude.trace.make_problem import make_problem
from rig.procedures.general.column_roles import Roles, roles_of
from rig.procedures.general.trace import search_table
from rig.procedures.general.trace.estimate import estimate
from rig.procedures.general.trace.run import problem_of
from rig.procedures.tables.table import Table

GRID = D1(180, 25, 13)
INDISTINCT = 9.0
"""A cause is as good a name as the true one if its columns come within three standard errors of what is hidden."""


@dataclass
class Case:
    """A run, with all that the methods are given and what is true of it.

    Arrays have a row for every observation and sensor, in units of the error's standard deviation, and the declared
    model is projected out of all of them.

    Attributes:
        y: (N,) response.
        hidden: (N,) what is truly there, free of noise.
        columns: (N, J) of the catalogue.
        names: (J,) effect of each.
        right: for every effect hidden, the names that are right.
        generic: (N, G) columns of a library that knows nothing of the bench.
        variables: of each sensor: its rows, and (n, v) variables with what a GAM makes of each.
        fold: (N,) what is left out together in cross-validation.
        declared: sum of squares of the declared model's own error, which all methods have alike.
        told: sum of squares of the error of a fit that was told what is hidden.
        traced: what `rig trace` makes of it: aliases by name that leads, and sum of squares of its error.

    """

    y: np.ndarray
    hidden: np.ndarray
    columns: np.ndarray
    names: list[str]
    right: list[set[str]]
    generic: np.ndarray
    variables: list
    fold: np.ndarray
    declared: float
    told: float
    traced: Callable[[], tuple[dict[str, set[str]], float]]


def folds_of(group, most=5):
    """(n,) fold of each row: whole groups together, at most so many folds."""
    _, index = np.unique(group, return_inverse=True)
    return index % min(most, int(index.max()) + 1)


def beside(columns, basis):
    """What an orthonormal basis (n, k) leaves of columns (n,) or (n, q)."""
    return columns - basis @ (basis.T @ columns)


def names_as_good(shape, blocks):
    """Names whose columns reproduce a shape (N,); `blocks` are (name, (N, q) columns) that go together."""
    good = set()
    for name, columns in blocks:
        if name not in good:
            left = shape - columns @ np.linalg.lstsq(columns, shape, rcond=1e-10)[0]
            if float(left @ left) <= min(INDISTINCT, 0.5 * float(shape @ shape)):
                good.add(name)
    return good


def night(names, rms, seed, **bench):
    """25 x 13 points over +-180 deg, six replications, three sensors, some effects of the catalogue hidden."""
    faulty = replace(_together(names, rms), **bench)
    given = {key: value for name in names for key, value in HIDDEN[name].options.items()}
    data, truth = simulate_night(faulty, GRID, seed, **given)
    problem = make_problem(data, CATALOGUE)
    sensors, n = problem.sensors, len(data)
    sd = [np.radians(faulty.sigma_deg) * s.S for s in faulty.sensors]
    bases = [orthonormal(problem.fits[s].columns(data.pitch_deg, data.roll_deg)) for s in sensors]

    def scaled(outputs):
        return [outputs[s] / u for s, u in zip(sensors, sd, strict=True)]

    def stacked(outputs):
        return np.concatenate([beside(v, b) for v, b in zip(scaled(outputs), bases, strict=True)])

    def error2(outputs):
        return sum(float(np.sum((v - t) ** 2)) for v, t in zip(scaled(outputs), scaled(truth), strict=True))

    columns = problem.columns_at("declared", range(len(problem.candidates))) / np.array(sd)[:, None, None]
    columns = columns.reshape(-1, columns.shape[2])
    catalogue = [c.effect.name for c in problem.candidates]
    without = {name: replace(_together([o for o in names if o != name], rms), **bench) for name in names}
    right = []
    for name in names:
        less = simulate_night(without[name], GRID, seed, **given)[1]
        shape = stacked({s: truth[s] - less[s] for s in sensors})
        right.append({HIDDEN[name].effect} | names_as_good(shape, _blocks(problem, columns)))
    told = {s: told_the_truth(faulty, list(without.values()) or [faulty], data, s) for s in sensors}
    declared = sum(
        float(np.sum((b.T @ (v - t)) ** 2)) for v, t, b in zip(scaled(data.outputs), scaled(truth), bases, strict=True)
    )

    def traced():
        found, leading = trace(data, validate=False), {}
        for sensor in found.sensors.values():
            for effect in sensor.effects:
                leading.setdefault(effect.effect, set()).update(effect.aliases)
        return leading, error2(found.predict(data))

    library, variables = _library_of_night(data), _variables_of_night(data)
    generic = np.zeros((len(sensors) * n, len(sensors) * library.shape[1]))
    for i, basis in enumerate(bases):
        generic[i * n : (i + 1) * n, i * library.shape[1] : (i + 1) * library.shape[1]] = beside(library, basis)
    return Case(
        y=stacked(data.outputs),
        hidden=stacked(truth),
        columns=columns,
        names=catalogue,
        right=right,
        generic=generic,
        variables=[(slice(i * n, (i + 1) * n), variables) for i in range(len(sensors))],
        fold=np.tile(folds_of(data.replicate, 6), len(sensors)),
        declared=declared,
        told=error2(told),
        traced=traced,
    )


def _together(names, rms):
    return together([sized(name, rms, GRID) for name in names]) if names else CLEAN


def _blocks(problem, columns):
    """Columns of each cause together; of one whose constant is searched, those of one value."""
    fixed = {}
    for j, candidate in enumerate(problem.candidates):
        if not candidate.effect.searched:
            fixed.setdefault(candidate.cause, []).append(j)
    searched = [unit for unit in problem.units if problem.candidates[unit[0]].effect.searched]
    for unit in [*fixed.values(), *searched]:
        yield problem.candidates[unit[0]].effect.name, columns[:, list(unit)]


def _library_of_night(data):
    """Waves in pitch times waves in roll, temperature, time and direction, and their products with the first waves."""
    a, r = np.radians(data.pitch_deg), np.radians(data.roll_deg)

    def waves(angle):
        return [np.ones_like(angle), *(w(k * angle) for k in (1, 2) for w in (np.sin, np.cos))]

    plain = [p * q for p in waves(a) for q in waves(r)][1:]
    plain += [w(k * angle) for angle in (a, r) for k in (3, 4) for w in (np.sin, np.cos)]
    others = [_unit(v) for v in (data.sensor_temperature_degC, data.elapsed_s)] + [data.pitch_side, data.roll_side]
    first = [np.sin(a), np.cos(a), np.sin(r), np.cos(r)]
    return np.column_stack([*plain, *others, *(v**2 for v in others[:2]), *(v * w for v in others for w in first)])


def _variables_of_night(data):
    columns = (data.pitch_deg, data.roll_deg, data.sensor_temperature_degC, data.elapsed_s)
    kinds = ("spline", "surface", "spline", "spline", "line", "line")
    return np.column_stack([*map(_unit, columns), data.pitch_side, data.roll_side]), kinds


def table(name, lab, rms, seed):
    """y = 3 + 2 x and an error of one, an effect of `proving.truth.table` hidden, or None."""
    missing = None if name is None else MISSING[name]
    effect = None if missing is None else missing.at(rms)
    c = simulate_table(lab, seed, effect)
    data, _ = roles_of(Table("simulated", c, True, {}), Roles(**options(lab)))
    extra = np.zeros(lab.n) if effect is None else effect(c, None)
    truth = 3.0 + 2.0 * c["x"] + extra
    basis, problem = orthonormal(data.columns), problem_of(data)
    columns = np.hstack([beside(k.term.columns, basis) for k in problem.candidates])
    names = [k.effect.name for k in problem.candidates for _ in range(k.term.columns.shape[1])]
    right, told = [], basis
    if missing is not None:
        blocks = ((k.effect.name, beside(k.term.columns, basis)) for k in problem.candidates)
        named = {n for n in names if n.startswith(missing.named)}
        right.append(named | names_as_good(beside(extra, basis), blocks))
        told = orthonormal(np.column_stack([data.columns, extra]))

    def traced():
        found = search_table(data)
        leading = {}
        for j in found.chosen:
            effect = found.judge.candidates[j].effect.name
            leading[effect] = {r.effect for r in found.judge.rivals(found.chosen, effect) if r.alias}
        return leading, float(np.sum((estimate(found.judge, found.chosen, data.tails).fitted - truth) ** 2))

    rng = np.random.default_rng(seed)
    group = next((c[key] for key in ("plot", "rep") if key in c), rng.permutation(lab.n))
    return Case(
        y=beside(c["y"], basis),
        hidden=beside(extra, basis),
        columns=columns,
        names=names,
        right=right,
        generic=beside(_library_of_table(c), basis),
        variables=[(slice(None), _variables_of_table(c))],
        fold=folds_of(group),
        declared=float(np.sum((basis.T @ (c["y"] - truth)) ** 2)),
        told=float(np.sum((told @ (told.T @ c["y"]) - truth) ** 2)),
        traced=traced,
    )


def _numbers_of_table(c):
    return [name for name in c if name not in ("y", "unit", "plot", "rep")]


def _library_of_table(c):
    """Polynomials of degree three in all variables, waves over x, levels of the group."""
    values = [_unit(c[name]) for name in _numbers_of_table(c)]
    powers = [np.prod(of, axis=0) for degree in (1, 2, 3) for of in combinations_with_replacement(values, degree)]
    u = np.pi * (c["x"] - c["x"].min()) / np.ptp(c["x"])
    waves = [w(k * u) for k in range(1, 7) for w in (np.sin, np.cos)]
    levels = [(c["unit"] == level).astype(float) for level in np.unique(c["unit"])[1:]] if "unit" in c else []
    return np.column_stack([*powers, *waves, *levels])


def _variables_of_table(c):
    names = _numbers_of_table(c)
    kinds = ["line" if len(np.unique(c[name])) < 5 else "spline" for name in names]
    columns = [_unit(c[name]) for name in names]
    if "unit" in c:
        columns, kinds = [*columns, c["unit"].astype(float)], [*kinds, "factor"]
    return np.column_stack(columns), tuple(kinds)


def _unit(values):
    """Values without mean, of unit standard deviation."""
    return (values - np.mean(values)) / np.std(values)


CLEAN_TABLES = {
    "independent errors": [Lab(20, 1), Lab(40, 2, clock=True), Lab(200, 4, groups=5, clock=True, sides=True)],
    "errors shared or correlated": [Lab(200, 2, clock=True, ar=0.7), Lab(60, 2, plots=12)],
}
