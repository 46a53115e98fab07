"""Shapes between whole plots: what a whole plot's offset may follow, and which of them it follows.

Twenty whole plots are few numbers, and a memory of the cold, a tare taken too early or a supply that is refilled has
no one column. Every transducer, and what all transducers have in common, is held against smooth shapes over the
temperatures, over the run, and over the temperatures before (`rig.fitter.trace.among_alike`), beside errors that may be
like those of their neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rig.fitter.arrays import FloatArray, IntArray
from rig.fitter.trace.among_alike import Shape, Shapes
from rig.fitter.trace.chance import ALPHA
from rig.fitter.trace.engine.beside import View
from rig.fitter.trace.engine.between import RHO, alike
from rig.fitter.trace.flexible import waves
from rig.fitter.trace.outcome import Finding, remains
from rig.procedures.pressure.effects.scene import PressureScene

LEVEL = 0.015
"""Of false alarms, over all transducers and places; a finding about the noise has the level of all of these."""
AT = (int(np.flatnonzero(RHO == 0.5)[0]),)
"""Correlation of neighbours at which chance has to be as rare."""
RUN, SMOOTH, TEMPERATURE, BOTH, BEFORE = 8, 4, 5, 3, 4
"""Waves over each."""
FOLLOWS_H = (6.0, 20.0)
"""Time constants with which something forgets the temperatures of the whole plots before."""
CONCERNED = 0.5
"""Share of what the transducers have in common, over an equal one, from which a transducer is concerned."""
SEED = 20261123


@dataclass(frozen=True)
class Course:
    """A shape that whole plots of a transducer follow.

    Attributes:
        where: in words.
        shape: how clearly, p over all transducers.
        common: whether it is what the transducers have in common.

    """

    where: str
    shape: Shape
    common: bool

    @property
    def slow(self) -> bool:
        """Whether errors that are like their neighbours do as well."""
        return self.shape.p >= LEVEL

    def unnamed(self) -> Finding:
        """As it is reported; of the noise where neighbours that are alike explain it."""
        where = f"between whole plots, {self.where}"
        if self.slow:
            text = "between whole plots: errors of neighbours in time are alike, or follow something slow"
            return remains(f"{text}; it may be a cause seen {self.where}", self.shape.share, stratum="noise")
        return remains(f"{where}{', in all transducers alike' if self.common else ''}", self.shape.share)


def courses(view: View, in_time: IntArray, scene: PressureScene) -> dict[int, Course]:
    """What whole plots follow beside the model, by the index of the transducer.

    Args:
        view: whole plots beside the model.
        in_time: (W,) these in the order of running.
        scene: of the same rows.
    """
    outputs, count = view.outputs, len(view.outputs)
    words, columns = zip(*_places(scene), strict=True)
    found: dict[int, Course] = {}

    def shapes_of(i: int) -> Shapes:
        size = view.sigma[i] / np.median(view.white.errors[i].length)
        return Shapes(alike(view, in_time, i), tuple(view.project(of, i) * size for of in columns))

    def clearest(i: int, series: FloatArray, times: int) -> Shape | None:
        one = shapes_of(i).clearest(series, AT, SEED)
        if one is None or (one.p * times >= LEVEL and one.p_independent * times >= ALPHA):
            return None
        return Shape(one.at, min(one.p * times, 1.0), one.p_independent * times, one.share)

    if count > 1:
        length = np.maximum(np.linalg.norm(outputs, axis=1), np.finfo(float).tiny)
        left, _, right = np.linalg.svd((outputs / length[:, None]).T, full_matrices=False)
        shape = clearest(0, left[:, 0], 2)
        if shape is not None:
            concerned = np.flatnonzero(count * right[0] ** 2 >= CONCERNED)
            found |= {int(i): Course(words[shape.at], shape, common=True) for i in concerned}
    for i, series in enumerate(outputs):
        if i in found and not found[i].slow:
            continue
        shape = clearest(i, series, 2 * count if count > 1 else 1)
        if shape is not None and (i not in found or shape.p < LEVEL):
            found[i] = Course(words[shape.at], shape, common=False)
    return found


def _places(scene: PressureScene) -> Iterator[tuple[str, FloatArray]]:
    """Words and columns (n, q), of unit size all together."""
    data = scene.data
    begun = _begun(scene)
    yield "along the run", _falling(waves(begun, RUN), 1.0)
    yield "slowly along the run", _falling(waves(begun, SMOOTH), 2.0)
    degC = {
        "the transducer's temperature": data.sensor_temperature_degC,
        "the electronics' temperature": data.sse_temperature_degC,
    }
    means = {text: of - _within(scene, of) for text, of in degC.items()}
    for text, mean in means.items():
        yield f"over {text}", _falling(waves(np.round(mean), TEMPERATURE), 1.0)
    one, other = (waves(np.round(mean), BOTH) for mean in means.values())
    if one.shape[1] and other.shape[1]:
        pairs = [(i, j) for i in range(one.shape[1]) for j in range(other.shape[1])]
        rough = np.array([i + j + 2.0 for i, j in pairs])
        yield (
            "over both temperatures",
            _falling(np.column_stack([one[:, i] * other[:, j] for i, j in pairs]), 1.0, rough),
        )
    for text, mean in means.items():
        span = float(np.ptp(mean))
        if span <= 1e-6:
            continue
        step = scene.step(degC[text])
        u = step / span
        yield (
            f"after the step of {text} before",
            _falling(np.column_stack([u, np.abs(u), np.tanh(4.0 * u), u**2]), 1.0, np.array([1.0, 1.0, 1.5, 1.5])),
        )
        yield f"over {text} of the whole plot before", _falling(waves(np.round(mean - step), BEFORE), 1.0)
        middle, half = float(mean.max() + mean.min()) / 2.0, span / 2.0
        apart = (mean - middle) / half
        parts = apart, np.maximum(apart, 0.0), np.minimum(apart, 0.0)
        sides = [scene.followed(of, tau) for tau in FOLLOWS_H for of in parts]
        yield f"as something that follows {text} with hours of delay", _falling(np.column_stack(sides), 0.0)


def _falling(columns: FloatArray, power: float, rough: FloatArray | None = None) -> FloatArray:
    """(n, q) columns, each the smaller the rougher it is; a mean square of half of one all together."""
    if not columns.shape[1]:
        return columns
    size = (np.arange(1.0, columns.shape[1] + 1) if rough is None else rough) ** -power
    return np.asarray(columns * size / np.sqrt(0.5 * np.sum(size**2)))


def _begun(scene: PressureScene) -> FloatArray:
    """(n,) hours at which the whole plot of each row began."""
    return scene.hours - scene.since_h


def _within(scene: PressureScene, values: FloatArray) -> FloatArray:
    """(n,) values less their mean over the whole plot."""
    index = scene.data.whole_plot_index
    return np.asarray(values - (np.bincount(index, values) / np.bincount(index))[index])
