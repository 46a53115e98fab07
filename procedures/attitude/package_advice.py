"""Recommendations 8 to 10 of NASA/TP-1999-209835: suitable uses of a package of one, two or three sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rig.fitter.arrays import FloatArray
from rig.procedures.attitude.merit import Usage
from rig.procedures.plan.advice import Advice

RATIO = 10.0
"""Acceptable ratio of uncertainty of roll to that required of pitch, and of y and z sensors to that of x."""


@dataclass(frozen=True)
class Package:
    """The sensors of a package, and their requirements.

    Attributes:
        sigma_deg: standard error of one output by axis, "x", "y", "z", as degrees of angle.
        roll_sd_deg: standard deviation of an independently measured roll; None if there is none.
        wanted_pitch_sd_deg: the required pitch uncertainty; by default that of the x sensor.
        coning_deg: largest coning angle Omega of the sensors.

    Raises:
        ValueError: an unknown axis, no x sensor, or a sigma that is not positive.
    """

    sigma_deg: Mapping[str, float]
    roll_sd_deg: float | None = None
    wanted_pitch_sd_deg: float | None = None
    coning_deg: float = 1.0

    def __post_init__(self) -> None:
        if "x" not in self.sigma_deg or not set(self.sigma_deg) <= {"x", "y", "z"}:
            raise ValueError(
                f"a package has an x sensor and may have y and z, not {', '.join(self.sigma_deg) or 'none'}"
            )
        given = {**self.sigma_deg, "roll": self.roll_sd_deg, "pitch": self.wanted_pitch_sd_deg}
        for what, sigma in given.items():
            if sigma is not None and not (np.isfinite(sigma) and sigma > 0):
                raise ValueError(f"the standard deviation of {what} must be a positive number, not {sigma:g}")
        if not 0 <= self.coning_deg < 90:
            raise ValueError(f"a coning angle is between 0 and 90 deg, not {self.coning_deg:g}")

    @property
    def axes(self) -> str:
        """Axes of its sensors, in order: "x", "xy", "xz" or "xyz"."""
        return "".join(sorted(self.sigma_deg))


def inferred_sd(package: Package, pitch_deg: FloatArray, roll_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Standard deviations of inferred pitch and roll, deg, by weighted least squares on well-aligned sensors.

    The inverse of F' W F with the derivatives of (sin a, -sin R cos a, -cos R cos a); infinite at singular attitudes.
    For equal y and z sensors the roll is eq. (108)'s. Its pitch is that of equal weights; with weights it is 1 / (cos^2
    a / sigma_x^2 + sin^2 a / sigma_y^2), never more. A single axis uses measured roll, eq. (82).

    Args:
        package: the sensors.
        pitch_deg: (n,).
        roll_deg: (n,).
    """
    a, r = np.radians(pitch_deg), np.radians(roll_deg)
    by_pitch = {"x": np.cos(a), "y": np.sin(r) * np.sin(a), "z": np.cos(r) * np.sin(a)}
    by_roll = {"x": 0.0 * a, "y": -np.cos(r) * np.cos(a), "z": np.sin(r) * np.cos(a)}
    weight = {axis: 1.0 / sigma**2 for axis, sigma in package.sigma_deg.items()}
    pp, pr, rr = (
        np.asarray(sum(w * one[axis] * other[axis] for axis, w in weight.items()))
        for one, other in ((by_pitch, by_pitch), (by_pitch, by_roll), (by_roll, by_roll))
    )
    floor = 1e-12 * max(weight.values())
    with np.errstate(divide="ignore", invalid="ignore"):
        if package.axes == "x":
            pitch = np.where(pp > floor, 1.0 / np.sqrt(pp), np.inf)
            known = np.inf if package.roll_sd_deg is None else package.roll_sd_deg
            return pitch, np.full_like(pitch, known)
        pitch_left = pp - np.where(rr > floor, pr**2 / rr, 0.0)
        roll_left = rr - np.where(pp > floor, pr**2 / pp, 0.0)
        return (
            np.where(pitch_left > floor, 1.0 / np.sqrt(pitch_left), np.inf),
            np.where(roll_left > floor, 1.0 / np.sqrt(roll_left), np.inf),
        )


def advise_package(package: Package | None, usage: Usage, *, roll: bool = True) -> tuple[Advice, Advice, Advice]:
    """Recommendations 8, 9 and 10; at most one applies.

    Args:
        package: the sensors; None if unknown.
        usage: attitudes of use.
        roll: whether they are calibrated with roll.
    """
    if package is not None and not roll and package.axes != "x":
        why = (
            "calibrated without roll, what a sensor across the pitch plane does is not known, nor what roll does to any"
        )
        found = _single(package, usage), _three(package, usage), _x_y(package, usage)
        return tuple(replace(a, holds=False, sentence=why) if a.applies else a for a in found)  # type: ignore[return-value]
    return _single(package, usage), _three(package, usage), _x_y(package, usage)


def _single(package: Package | None, usage: Usage) -> Advice:
    said = "a single-axis package wants its roll measured to 10 times the pitch uncertainty wanted"
    share = np.tan(np.radians(1.0 if package is None else package.coning_deg))
    if package is None or package.axes != "x":
        why = (
            f"a roll known to {RATIO:g} times the pitch adds {_percent(np.hypot(1, RATIO * share) - 1)} at 1 deg coning"
        )
        return not_for(8, said, f"{_has(package)}; {why}" if package is None else _has(package))
    wanted = package.wanted_pitch_sd_deg or package.sigma_deg["x"]
    pitch = _worst(package, usage)[0]
    end = f"were roll known exactly, pitch within {usage} {_known(pitch)}"
    if package.roll_sd_deg is None:
        free = float(np.ptp(usage.roll_deg)) == 0.0
        return Advice(8, said, free, f"roll is not measured; {end}")
    adds = share * package.roll_sd_deg
    return Advice(
        8, said, package.roll_sd_deg <= RATIO * wanted * (1 + 1e-9),
        f"roll is known to {package.roll_sd_deg / wanted:.3g} times the {wanted:.1e} deg wanted of pitch and adds up "
        f"to {adds:.1e} deg to it at {package.coning_deg:g} deg of coning; {end}"
    )  # fmt: skip


def _three(package: Package | None, usage: Usage) -> Advice:
    said = "a three-axis package measures everywhere but roll near +-90 deg of pitch; y and z within 10 times x"
    if package is None or package.axes != "xyz":
        return not_for(9, said, _has(package))
    pitch, roll = _worst(package, usage)
    ratio = max(package.sigma_deg["y"], package.sigma_deg["z"]) / package.sigma_deg["x"]
    best = min(package.sigma_deg["y"], package.sigma_deg["z"])
    sentence = f"y and z have up to {ratio:.3g} times the uncertainty of x; within {usage} pitch {_known(pitch)}"
    return Advice(9, said, ratio <= RATIO and roll <= RATIO * best, f"{sentence}, and roll {_known(roll)}")


def _x_y(package: Package | None, usage: Usage) -> Advice:
    said = "an x-y package measures only away from +-90 deg of pitch and of roll; y within 10 times x"
    if package is None or package.axes != "xy":
        return not_for(10, said, _has(package))
    pitch, roll = _worst(package, usage)
    ratio = package.sigma_deg["y"] / package.sigma_deg["x"]
    sentence = f"y has {ratio:.3g} times the uncertainty of x; within {usage} pitch {_known(pitch)}"
    holds = ratio <= RATIO and max(pitch / package.sigma_deg["x"], roll / package.sigma_deg["y"]) <= RATIO
    low, high = usage.roll_deg
    return Advice(10, said, holds, f"{sentence}, and roll, from {low:g} to {high:g} deg, {_known(roll)}")


def _worst(package: Package, usage: Usage) -> tuple[float, float]:
    """Largest standard deviations of pitch and roll over the range of use, including singular attitudes."""
    pitch, roll = (_angles(*span) for span in (usage.pitch_deg, usage.roll_deg))
    found = inferred_sd(package, *(g.ravel() for g in np.meshgrid(pitch, roll)))
    return float(found[0].max()), float(found[1].max())


def _angles(low: float, high: float) -> FloatArray:
    """Angles of a range: 91 from end to end, and the singular ones inside."""
    odd = 90.0 + 180.0 * np.arange(np.ceil((low - 90.0) / 180.0), np.floor((high - 90.0) / 180.0) + 1)
    return np.concatenate([np.linspace(low, high, 91), odd])


def _has(package: Package | None) -> str:
    return "no sensors were told" if package is None else f"the package has {', '.join(package.axes)}"


def not_for(number: int, said: str, sentence: str) -> Advice:
    """A recommendation that does not concern the procedure."""
    return Advice(number, said, True, sentence, applies=False)


def _known(sd_deg: float) -> str:
    return f"is known to {sd_deg:.1e} deg at worst" if np.isfinite(sd_deg) else "is undetermined at some attitudes"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
