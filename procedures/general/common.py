"""Effects that all sensors of a run share: one cause outside of them is more likely than one in each.

What the sensors have in common shows in one of two ways. An error of a shared supply or reader is the same in each
output. An error of the source or of the reference standard is the same in the quantity that was set, so it is in each
output times its slope.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.fitter.errors import FitError
from rig.fitter.formula import Formula
from rig.fitter.quantiles import f_tail
from rig.procedures.column_names import spelled, unit_of
from rig.procedures.general.evaluate import GeneralTraced
from rig.procedures.general.trace import FoundTableEffect

SAME = 1e-2
"""Probability below which sizes differ by more than their errors."""
SHAPE = 0.1
"""Part, rms, by which the shape of an effect may differ between sensors that are said to share it."""


@dataclass(frozen=True)
class Common:
    """An effect that every traced sensor of a run has.

    Attributes:
        effect: its name.
        outputs: the sensors' outputs.
        same_in: the unit of the outputs, or the name of a setting, in which it is of one size in all of them. Empty if
            sizes differ by more than their errors.
        p: probability of such differences of sizes by chance; of each of `same_in`.
        spread: largest difference of its sizes in the outputs, as a part of their mean magnitude.
        both_signs: whether it raises some outputs and lowers others.
        readers: what reads the outputs and the standards, by column, where that is known.
        sources: what sets each setting.
    """

    effect: str
    outputs: tuple[str, ...]
    same_in: tuple[str, ...]
    p: tuple[float, ...]
    spread: float
    both_signs: bool = False
    readers: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """What it means, and the measurement that tells."""
        count = f"all {len(self.outputs)} outputs"
        if not self.same_in:
            sizes = f"sizes up to {100.0 * self.spread:.2g} % apart, which is more than their errors"
            return (
                f"{self.effect} is in {count}, with {'both signs' if self.both_signs else sizes}: "
                f"each has a cause of its own, or all respond to one cause in their own way"
            )
        settings = [name for name in self.same_in if name not in {spelled(unit_of(one)) for one in self.outputs}]
        pairs = [self._of_outputs()] if len(settings) < len(self.same_in) else []
        pairs += [self._of_setting(name) for name in settings]
        places, tells = zip(*pairs, strict=True)
        return (
            f"{self.effect} is common to {count}: of one size in {' and in '.join(self.same_in)}, within errors. Runs "
            f"like this one cannot tell the sensors from what they share: {', '.join(places)}. One cause there is more "
            f"likely than {len(self.outputs)} alike. To tell: {', and '.join(tells)}"
        )

    def _of_outputs(self) -> tuple[str, str]:
        """What outputs share beside a setting, by the bench where that is known, and what would tell."""
        read_by = {self.readers.get(one, "") for one in self.outputs}
        if len(read_by) == len(self.outputs):
            return "a supply that they share (each has a reader of its own)", "give one of them another supply"
        (reader,) = read_by if len(read_by) == 1 else ("",)
        place = f"their reader {reader} or a supply that they share" if reader else "a supply or reader that they share"
        return place, "read one of them with another reader or supply"

    def _of_setting(self, name: str) -> tuple[str, str]:
        source, standard = self.sources.get(name, ""), self.readers.get(name, "")
        which = f" ({source})" if source else "", f" ({standard})" if standard else ""
        if source and not standard:  # nothing but the source says what the setting is
            return f"the source of {name}{which[0]}", f"repeat the run with another source of {name}"
        return (
            f"the source{which[0]} or the reference{which[1]} of {name}",
            f"repeat the run with another source or reference of {name}",
        )

    def to_json(self) -> dict[str, Any]:
        """JSON values."""
        same = [{"same_in": name, "p": p} for name, p in zip(self.same_in, self.p, strict=True)]
        told = {"effect": self.effect, "outputs": list(self.outputs), "same": same, "spread": self.spread}
        return {**told, "sentence": self.sentence}


def common_of(each: Mapping[str, GeneralTraced]) -> tuple[Common, ...]:
    """Effects that all outputs of a run have; () for a single output.

    Those without a known error in any output are left out: nothing says then whether their sizes agree.
    """
    if len(each) < 2:
        return ()
    found = {output: {one.effect: one for one in traced.trace.added} for output, traced in each.items()}
    names = [name for name in next(iter(found.values())) if all(name in own for own in found.values())]
    common = (_common(name, each, {output: own[name] for output, own in found.items()}) for name in names)
    return tuple(one for one in common if one is not None)


def _common(name: str, each: Mapping[str, GeneralTraced], own: Mapping[str, FoundTableEffect]) -> Common | None:
    shapes = np.stack([one.contribution for one in own.values()])
    mean = shapes.mean(0)
    sizes = shapes @ mean / float(mean @ mean)
    alike = bool(
        np.all(np.linalg.norm(shapes - np.outer(sizes, mean), axis=1) <= SHAPE * np.linalg.norm(shapes, axis=1))
    )
    by_time = all(one.dynamic for one in own.values())
    if by_time:  # what is left of it depends on when an output was read; its coefficient does not
        sizes = np.array([one.coefficients[0] for one in own.values()])
    errors = sizes * np.array([_relative_error(one, by_time=by_time) for one in own.values()])
    if not np.isfinite(errors).any():
        return None
    df = min((one.df for one in own.values() if one.df is not None), default=1.0)
    spread, signs = float(np.ptp(sizes) / np.abs(sizes).mean()), np.sign(sizes)
    table = next(iter(each.values())).table
    told = Common(name, tuple(own), (), (), spread, bool(np.ptp(signs) > 1), table.readers, table.sources)
    if not alike:
        return told
    units = {spelled(unit_of(output)) for output in own}
    tried = {units.pop(): sizes} if len(units) == 1 else {}
    ratios = {
        setting: sizes / slopes
        for setting in _settings(each)
        if (slopes := _slopes(setting, each, np.abs(mean))) is not None
    }
    scaled = {name: ratio / ratio.mean() for name, ratio in {**tried, **ratios}.items()}
    chances = {name: _p_same(size, errors / sizes * size, df) for name, size in scaled.items()}
    same = {name: p for name, p in chances.items() if p >= SAME}
    return replace(told, same_in=tuple(same), p=tuple(same.values()))


def _relative_error(effect: FoundTableEffect, *, by_time: bool) -> float:
    """Standard error of its size, relative to it: of its first coefficient, or of what it adds to the output."""
    if by_time:
        return abs(effect.stderr[0] / effect.coefficients[0])
    pairs = zip(effect.coefficients, effect.given, strict=True)
    return min((abs(error / value) for value, error in pairs if value and error > 0.0), default=np.inf)


def _p_same(sizes: FloatArray, errors: FloatArray, df: float) -> float:
    """Probability of such differences, if all sizes are one."""
    weights = errors**-2.0
    mean = float(np.sum(weights * sizes) / np.sum(weights))
    free = len(sizes) - 1
    return f_tail(float(np.sum(weights * (sizes - mean) ** 2)) / free, free, df)


def _settings(each: Mapping[str, GeneralTraced]) -> Sequence[str]:
    """Settings of the declared models of all outputs."""
    every = [list(one.parts.get("settings", ())) for one in each.values()]
    return [name for name in every[0] if all(name in own for own in every)]


def _slopes(setting: str, each: Mapping[str, GeneralTraced], weights: FloatArray) -> FloatArray | None:
    """(S,) mean slope of each output over a setting, by the declared models; None if one may be zero, or is unknown."""
    slopes = []
    for traced in each.values():
        try:
            formula = Formula.parse(traced.trace.declared)
            count = len(formula.columns(traced.table.columns)[0])
            slope = formula.slope(traced.trace.after.fit.coefficients[:count], traced.table.columns, setting)
        except FitError:
            return None
        if not np.all(np.sign(slope) == np.sign(slope[0])) or slope[0] == 0.0:
            return None
        slopes.append(float(weights @ slope / weights.sum()))
    return np.array(slopes)
