"""Pitch and roll of a package from its outputs, each with a standard deviation, a 95 % interval and flags."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.procedures.attitude.infer import two_axis
from rig.procedures.attitude.infer.alternatives import cover
from rig.procedures.attitude.infer.answer import (
    BAD_READING,
    BOTH_OPEN,
    FAR_FROM_1_G,
    HALF_TURN,
    NOT_1_G,
    PITCH_OPEN,
    ROLL_OPEN,
    TWO_FIT,
    InferredAttitude,
    empty,
    flag_ranges,
    leave_open,
    nowhere,
    put,
    reason,
    turn_over,
)
from rig.procedures.attitude.infer.blocks import in_blocks
from rig.procedures.attitude.infer.calibration import AttitudeCalibration
from rig.procedures.attitude.infer.known_roll import DECISIVE, KnownRoll, polish, wrap
from rig.procedures.attitude.infer.package import NORMAL_95, Propagation, angles, gravity, t_limits
from rig.procedures.attitude.infer.question import (
    Question,
    absurd_squares,
    beyond,
    each,
    f_absurd,
    near_of,
    noise_of,
    worse_at_most,
)
from rig.procedures.attitude.infer.singular import FEWEST_SD, normal
from rig.procedures.attitude.infer.tangent import Tangent
from rig.procedures.attitude.infer.three_axis import ThreeAxis

_TERMS_ITERATIONS, _TERMS_TOLERANCE = 12, 1e-12


def infer_attitude(
    calibration: AttitudeCalibration,
    outputs_V: ArrayLike,
    *,
    roll_deg: ArrayLike | None = None,
    roll_sd_deg: ArrayLike = 0.0,
    near_deg: tuple[ArrayLike, ArrayLike] | None = None,
    sensor_temperature_degC: ArrayLike | None = None,
    noise_sd_V: ArrayLike | None = None,
    weighted: bool = True,
) -> InferredAttitude:
    """Attitude of (n, S) outputs, columns in the order of `calibration.sensors`.

    Without `roll_deg` two sensors or more determine pitch and roll (eqs. 83 to 95, 99 to 108); a calibration without
    roll assumes zero roll (76 to 78). With it any number of sensors determines pitch (79 to 82, 96 to 98).

    (a, R) and (180 deg - a, R + 180 deg) are one attitude. The result is the pair, and among several solutions of the
    package (`InferredAttitude.assumed`) the solution, nearest to `near_deg`. If the calibration has alternatives
    (causes that its data cannot separate), angles are those of the named causes, and intervals cover all of them.

    Args:
        calibration: of the package.
        outputs_V: (n, S), or (n,) of a single sensor.
        roll_deg: (n,) or one for all, measured independently; None to infer it.
        roll_sd_deg: (n,) or one for all, standard deviation of the measured roll, in deg.
        near_deg: (pitch, roll), (n,) or one for all: an attitude near the package's. None: level, and for an x-z
            package rolled to +90 deg. The default of an x-y package is upright.
        sensor_temperature_degC: (n,) or one for all; needed if the calibration has temperature terms.
        noise_sd_V: (S,) or one for all, known standard deviation of a new reading (of a mean of m, sigma_V divided by
            the root of m); None for that of the calibration.
        weighted: whether three or more sensors are weighted by their noise when they determine pitch and roll. False:
            equal weights, as in eqs. (103) to (108).

    Raises:
        FitError: the sensors do not determine the requested angles.
    """
    given: dict[str, Any] = {
        "roll_deg": roll_deg,
        "roll_sd_deg": roll_sd_deg,
        "near_deg": near_deg,
        "noise_sd_V": noise_sd_V,
        "weighted": weighted,
    }
    out = _as_named(calibration, outputs_V, sensor_temperature_degC=sensor_temperature_degC, **given)
    found, untold = [], []
    for named, member, other in calibration.alternatives:
        if other.needs_temperature and sensor_temperature_degC is None:
            untold.append(member)
        else:
            degC = sensor_temperature_degC
            found.append((named, _as_named(other, outputs_V, sensor_temperature_degC=degC, **given)))
    cover(out, found, "pitch")
    if roll_deg is None and calibration.roll:
        cover(out, found, "roll")
    if untold:
        everywhere = np.ones(len(out.flag), np.bool_)
        reason(out.flag, everywhere, f"the interval leaves out {', '.join(untold)}: no sensor temperature is given")
    return out


def _as_named(
    calibration: AttitudeCalibration,
    outputs_V: ArrayLike,
    *,
    roll_deg: ArrayLike | None,
    roll_sd_deg: ArrayLike,
    near_deg: tuple[ArrayLike, ArrayLike] | None,
    sensor_temperature_degC: ArrayLike | None,
    noise_sd_V: ArrayLike | None,
    weighted: bool,
) -> InferredAttitude:
    """Attitudes as by `infer_attitude`; by one calibration, without its alternatives."""
    outputs = np.asarray(outputs_V, np.float64)
    outputs = outputs[:, None] if outputs.ndim == 1 and len(calibration.sensors) == 1 else outputs
    if outputs.ndim != 2 or outputs.shape[1] != len(calibration.sensors):
        names = ", ".join(calibration.names)
        raise ValueError(f"outputs are expected as (n, {len(calibration.sensors)}), {names}; found {outputs.shape}")
    n = len(outputs)
    if roll_deg is not None and not calibration.roll:
        raise FitError("the package was calibrated without roll: the influence of roll on its outputs is unknown")
    given = each("roll_deg", 0.0 if roll_deg is None else roll_deg, n)
    roll = np.radians(given) if roll_deg is not None or not calibration.roll else None
    if roll is None and len(calibration.sensors) == 1:
        raise FitError("one sensor does not determine roll: measured roll is needed")
    spread = np.radians(np.asarray(roll_sd_deg, np.float64))
    if not np.all((spread >= 0) & np.isfinite(spread)):
        raise FitError("roll_sd_deg: a standard deviation is a number that is not negative")
    roll_variance = each("roll_sd_deg", spread**2, n)
    near_pitch, near_roll, over = near_of(calibration.matrix, near_deg, n, free=roll is None)
    degC = None if sensor_temperature_degC is None else each("sensor_temperature_degC", sensor_temperature_degC, n)
    if degC is None and calibration.needs_temperature:
        raise FitError("the calibration has temperature terms: the sensors' temperature is needed")
    warmth = each(
        "warmth", 0.0 if degC is None or calibration.reference_degC is None else degC - calibration.reference_degC, n
    )
    noise = noise_of(calibration, noise_sd_V)
    weights = 1.0 / noise.variance if weighted else np.full(len(noise.variance), 1.0 / noise.variance.max())
    out = empty(n)
    three, tangent, offsets = None, None, calibration.offsets_V[:, None]
    if roll is None:
        tangent = Tangent.of(calibration.matrix, weights)
    if roll is None and len(calibration.sensors) > 2:
        three = ThreeAxis.of(np.zeros(len(calibration.sensors)), calibration.matrix, weights**-0.5)
    worse = worse_at_most(calibration, noise)
    absurd = absurd_squares(calibration, worse, free=roll is None)

    def block(p: slice) -> None:
        question = Question(
            calibration,
            noise,
            weights,
            np.subtract(outputs[p].T, offsets, order="C"),
            warmth[p],
            near_pitch[p],
            near_roll[p],
            over[p],
            None if roll is None else roll[p],
            roll_variance[p],
            weighted and len(calibration.sensors) > 1 and (roll is not None or three is not None),
            worse,
            absurd,
            tangent,
        )
        part = InferredAttitude(**{f.name: getattr(out, f.name)[p] for f in fields(InferredAttitude)})
        if question.roll is not None:
            _known_roll(question, part)
            part.roll_deg[:] = given[p]
        elif three is None:
            _two_axes(question, part)
        else:
            _three_axes(question, three, part)
        flag_ranges(calibration, part, None if degC is None else degC[p])
        _bad_readings(question, part)

    in_blocks(n, block)
    return out


def _three_axes(q: Question, three: ThreeAxis, out: InferredAttitude) -> None:
    matrix = q.calibration.matrix
    y, extra = q.y, np.zeros((1, 1))
    for _ in range(_TERMS_ITERATIONS):
        g = three.gravity(y.T)
        again = beyond(q, g)
        if again is None or _settled(again, extra):
            break
        y, extra = q.y - again, again
    left = matrix @ g
    left -= y
    left *= left
    squares = q.weights @ left
    _tangent_errors(q, g, out)
    wrong = ~((squares <= q.absurd) & (np.einsum("in,in->n", g, g) > 0.5))  # zero g fits no output
    if wrong.any():
        reason(out.flag, wrong, NOT_1_G)
        length = np.linalg.norm(three.to_principal @ y, axis=0)
        nowhere(out, wrong & ~(np.abs(length - 1.0) <= FAR_FROM_1_G))


def _two_axes(q: Question, out: InferredAttitude) -> None:
    matrix = q.calibration.matrix
    near = gravity(q.near_pitch, q.near_roll)
    extra = np.zeros_like(q.y)
    for _ in range(_TERMS_ITERATIONS):
        g, t, length = two_axis.solve(matrix, q.y - extra, near)
        again = beyond(q, g)
        if again is None or _settled(again, extra):
            break
        extra = again
    out.assumed[:] = True
    error = np.sqrt(_tangent_errors(q, g, out).sum(axis=0))
    folded = ~(np.abs(t) > FEWEST_SD * error)
    if folded.any():
        _open_fold(q, g, t, length, np.flatnonzero(folded), out)


def _tangent_errors(q: Question, g: FloatArray, out: InferredAttitude) -> FloatArray:
    """Angles and their errors of (3, n) gravity in `out`; returns (2, n) variances, rad^2."""
    assert q.tangent is not None
    gains, c = q.tangent.gains(g)
    both = Propagation.at(q.calibration, q.noise, g, q.warmth).spread(gains, weighed=q.weighed)
    sd, limit = np.sqrt(both.variance), t_limits(both.df)
    out.df[:], out.roll_df[:] = both.df
    pitch, roll = angles(g, c)
    put(out, "pitch", pitch, sd[0], limit[0])
    put(out, "roll", roll, sd[1] / c, limit[1])
    pole = ~(c > FEWEST_SD * sd[1])
    if pole.any():
        # at the pole itself pitch is below 90 deg by a distance in two directions: F(2, df), not t
        df = np.minimum(both.df[0, pole], 1e9)
        half = np.degrees(np.sqrt(df * np.expm1(-2.0 / df * np.log(0.05))) * sd[:, pole].max(axis=0))
        out.pitch_lo95_deg[pole] = np.maximum(out.pitch_deg[pole] - half, -90.0)
        out.pitch_hi95_deg[pole] = np.minimum(out.pitch_deg[pole] + half, 90.0)
        leave_open(out, "roll", pole, -HALF_TURN, HALF_TURN)
        reason(out.flag, pole, ROLL_OPEN)
    if q.over.any():
        turn_over(out, q.over)
    return both.variance


def _open_fold(
    q: Question,
    g: FloatArray,
    t: FloatArray,
    length: FloatArray,
    rows: NDArray[np.int64],
    out: InferredAttitude,
) -> None:
    """At the meeting of the two solutions of two axes all attitudes between them, and their errors, are possible."""
    matrix = q.calibration.matrix
    g, t, length, warmth = g[:, rows], t[rows], length[rows], q.warmth[rows]
    n = normal(matrix)
    flat = g - n[:, None] * t
    flat = flat / np.maximum(np.linalg.norm(flat, axis=0), np.finfo(float).tiny)
    errors = Propagation.at(q.calibration, q.noise, flat, warmth)
    radial = errors.spread(two_axis.radial_gains(matrix, g))
    sideways = errors.spread(np.asarray(np.linalg.pinv(matrix).T @ np.cross(n, flat.T).T, np.float64))
    k = t_limits(radial.df)
    reach = np.sqrt(np.maximum(1.0 - length**2 + 2.0 * k * np.sqrt(radial.variance), 0.0))
    over = q.over[rows]
    pitch_low, pitch_high, roll_low, roll_high = two_axis.arc(matrix, g, t, reach, over)
    half = k * np.sqrt(sideways.variance)
    cosine = np.minimum(np.abs(np.cos(pitch_low)), np.abs(np.cos(pitch_high)))
    no_roll = ~(cosine > FEWEST_SD * half)
    roll_low, roll_high = roll_low - half / cosine, roll_high + half / cosine
    no_roll |= roll_high - roll_low >= 2 * np.pi
    turn = np.where(over, np.pi, 0.0)
    mask = np.zeros(len(out.flag), bool)
    mask[rows] = True
    leave_open(out, "pitch", mask, np.degrees(pitch_low - half), np.degrees(pitch_high + half))
    leave_open(
        out,
        "roll",
        mask,
        np.where(no_roll, -HALF_TURN, np.degrees(roll_low + turn)),
        np.where(no_roll, HALF_TURN, np.degrees(roll_high + turn)),
    )
    out.flag[rows] = BOTH_OPEN
    absurd = np.sqrt(f_absurd(1, q.calibration)) * np.sqrt(radial.variance)
    none = np.zeros(len(out.flag), bool)
    none[rows] = ~(length - 1.0 <= absurd)
    nowhere(out, none)


def _known_roll(q: Question, out: InferredAttitude) -> None:
    assert q.roll is not None
    roll, matrix = q.roll, q.calibration.matrix
    problem = KnownRoll.of(matrix, roll, q.roll_variance, q.noise.variance)
    measured, extra = problem, np.zeros_like(q.y)
    for _ in range(_TERMS_ITERATIONS):
        problem, y = measured, q.y - extra
        pitch, out.assumed[:] = problem.solve(y, q.near_pitch)
        pitch, corrected, problem, y = polish(matrix, problem, y, roll, pitch)
        g = gravity(pitch, roll)
        again = beyond(q, g)
        if again is None or _settled(again, extra):
            break
        extra = again
    gains, information = problem.gains(pitch)
    of_roll = problem.roll_errors(pitch, gains, information)
    errors = Propagation.at(q.calibration, q.noise, g, q.warmth)
    spread = errors.spread(gains, of_roll, weighed=q.weighed)
    sd = np.sqrt(spread.variance)
    out.df[:], out.roll_df[:] = spread.df, np.inf
    limit = t_limits(spread.df)
    put(out, "pitch", pitch, sd, limit)
    given = np.sqrt(q.roll_variance)
    put(out, "roll", roll, given, np.full(len(roll), NORMAL_95))
    bend = problem.C * np.sin(pitch) + problem.D * np.cos(pitch)
    curvature = np.sqrt(np.einsum("sn,sn->n", bend, problem.whiten(bend, pitch)) / information)
    flat = ~(FEWEST_SD * sd * curvature < 1.0)
    least = problem.cost(y, pitch)
    if flat.any():
        rows = np.flatnonzero(flat)
        lower, higher = _reach(problem.take(rows), y[:, rows], pitch[rows], limit[rows], q.worse)
        leave_open(out, "pitch", flat, np.degrees(pitch[rows] - lower), np.degrees(pitch[rows] + higher))
        reason(out.flag, flat, PITCH_OPEN)
    if len(q.y) == 2 and np.any(q.roll_variance > 0):
        _mirrored(q, pitch, corrected, limit * sd, out)
    if len(q.y) == 1:
        nowhere(out, flat & (least > q.absurd))
    else:
        reason(out.flag, least > q.absurd, NOT_1_G)


def _mirrored(q: Question, pitch: FloatArray, roll: FloatArray, half: FloatArray, out: InferredAttitude) -> None:
    """Two outputs fit a second attitude exactly; measured roll may be too uncertain to exclude it."""
    assert q.roll is not None
    across = np.cross(*q.calibration.matrix)
    n = across / max(float(np.linalg.norm(across)), np.finfo(float).tiny)
    g = gravity(pitch, roll)
    other_pitch, other_roll = angles(g - 2.0 * n[:, None] * (n @ g))
    over = np.cos(pitch) < 0
    other_pitch = pitch + wrap(np.where(over, np.pi - other_pitch, other_pitch) - pitch)
    other_roll = np.where(over, other_roll + np.pi, other_roll)
    worse = wrap(other_roll - q.roll) ** 2 - wrap(roll - q.roll) ** 2
    open_ = (worse < DECISIVE * q.roll_variance) & (np.abs(other_pitch - pitch) > 0.25 * half)
    if open_.any():
        low, high = np.minimum(pitch, other_pitch) - half, np.maximum(pitch, other_pitch) + half
        leave_open(out, "pitch", open_, np.degrees(low[open_]), np.degrees(high[open_]))
        out.flag[open_] = TWO_FIT


def _reach(
    problem: KnownRoll, y: FloatArray, pitch: FloatArray, limit: FloatArray, worse: float
) -> tuple[FloatArray, FloatArray]:
    limit = np.where(np.isfinite(limit), limit, NORMAL_95)
    # one sensor: the quality of the fit counts, not the difference from the best
    room = problem.cost(y, pitch) if len(y) == 1 else 0.0
    return problem.reach(y, pitch, np.maximum(limit**2 * worse - room, 0.0))


def _bad_readings(q: Question, out: InferredAttitude) -> None:
    good = np.isfinite(q.y[0])
    for y in q.y[1:]:
        good &= np.isfinite(y)
    if q.calibration.needs_temperature:
        good = good & np.isfinite(q.warmth)
    if q.roll is not None:
        good = good & np.isfinite(q.roll)
    nowhere(out, np.asarray(~good), BAD_READING)


def _settled(again: FloatArray, before: FloatArray) -> bool:
    moved = np.abs(again - before)
    return bool(np.all(~(moved > _TERMS_TOLERANCE)))
