"""Budgets with the effects that a trace finds, held at their size while errors of instruments are carried through.

Where the data cannot separate the causes of an effect, the results by every one of them are as good. They differ from
those by the named one by a model error, which has a line of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.budget import TypeA
from rig.procedures.attitude.budget import AttitudeEvaluation
from rig.procedures.attitude.data import AttitudeData
from rig.procedures.attitude.effects import CATALOGUE
from rig.procedures.attitude.fitted import Others, traced_effects
from rig.procedures.attitude.infer import AttitudeCalibration
from rig.procedures.attitude.infer.traced import Volts, calibrate_traced
from rig.procedures.attitude.results import Model
from rig.procedures.evaluate.budgeting import alike
from rig.procedures.evaluate.scatter_for_budgets import Scatter


class TracedEvaluation(AttitudeEvaluation):
    """The declared model with traced effects, fitted to every sensor of a run."""

    def __init__(
        self,
        data: AttitudeData,
        at_deg: Sequence[tuple[float, float]],
        *,
        temperature: bool,
        gravity: float | None,
        effects: tuple[Volts, Others] | None = None,
    ) -> None:
        super().__init__(data, at_deg, temperature=temperature, gravity=gravity)
        own, others = traced_effects(data, temperature=temperature) if effects is None else effects
        self._effects = own
        self._plain = calibrate_traced(data, own, others, temperature=temperature)
        held = {name: np.zeros(len(data)) for name in data.outputs}
        for by in own.values():
            for sensor, volts in by.items():
                held[sensor] = held[sensor] + (volts if volts.ndim == 1 else volts.sum(axis=1))
        self._held = np.array([held[name] for name in data.outputs])

    def _by_side(self, name: str, axis: str) -> FloatArray | None:
        """(n,) the part of a sensor's readings taken off that is of the direction of an axis, V; None without any.

        Only what is the sensor's, or cannot be told from it: the head has no part in use.
        """
        perhaps = {named for named, member, _ in self._plain.alternatives if _sided(member, axis)}
        each = [by[name] for one, by in self._effects.items() if name in by and (_sided(one, axis) or one in perhaps)]
        return np.sum([one if one.ndim == 1 else one.sum(axis=1) for one in each], axis=0) if each else None

    def _solved(self, moved: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """(S, k) coefficients of the declared model and (S, n) residuals, with additions to columns, of outputs without
        the effects.
        """
        without = {name: moved.get(name, 0.0) - held for name, held in zip(self._data.outputs, self._held, strict=True)}
        return super()._solved({**moved, **without})

    def _coefficients(self, moved: Mapping[str, FloatArray]) -> FloatArray:
        """(S, 4) coefficients of the declared model with additions to columns. Those of the calibration with effects,
        changed as errors change the others.
        """
        own = np.array([one.coefficients[:4] for one in self._plain.sensors])
        return np.asarray(own + super()._coefficients(moved) - super()._coefficients({})) if moved else own

    def _with_scatter(self, calibration: AttitudeCalibration, scatters: Mapping[str, Scatter]) -> AttitudeCalibration:
        """The calibration unchanged: the effects are out of the residuals."""
        return calibration

    def _beside(self, loops: Volts) -> AttitudeCalibration:
        """See `AttitudeEvaluation`."""
        found = calibrate_traced(self._data, {**self._effects, **loops}, (), temperature=self._temperature)
        return replace(found, alternatives=self._plain.alternatives)

    def model_errors(self) -> Iterator[TypeA]:
        """The differences between causes that the data cannot separate, all of them equally likely."""
        return alike((named, member, self._moved(other)) for named, member, other in self._plain.alternatives)

    def _moved(self, other: AttitudeCalibration) -> FloatArray | None:
        """(m,) how far the results by a calibration with another cause are away; None if it gives none."""
        own = np.array([one.coefficients[:4] for one in other.sensors])
        values = Model(other, self._at, self._gravity).values(own, self._model.readings, self._gravity)
        return values - self.results.values if np.isfinite(values).all() else None

    def aside(self) -> Mapping[str, FloatArray]:
        """See `Evaluation`."""
        return dict(zip(self._data.outputs, self._held, strict=True))

    def holds(self) -> Mapping[str, Mapping[str, str]]:
        """See `Evaluation`."""
        every = {s: {name: "without it" for name, by in self._effects.items() if s in by} for s in self._data.outputs}
        return {sensor: states for sensor, states in every.items() if states}

    def notes(self) -> Iterable[str]:
        """Sentences about the scatter."""
        if self._effects:
            yield f"with the effects {', '.join(self._effects)}, held at the size that the trace found"
        yield from self._plain.notes


def _sided(effect: str, axis: str) -> bool:
    """Whether the sensor's output depends, by an effect of the catalogue, on the side from which an axis arrived."""
    return any(one.name == effect and one.source == "sensor" and f"{axis} sides" in one.needs for one in CATALOGUE)
