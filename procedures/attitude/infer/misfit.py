"""Remaining lack of fit of a calibration with its effects, by sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any


@dataclass(frozen=True)
class Misfit:
    """Lack of fit of one sensor.

    Attributes:
        T_bias: lack of fit against the scatter of readings at one point; NaN if it cannot be tested.
        F_bias_95: its 95 % limit.
        sigma_bias_deg: standard deviation of the lack of fit.
        model_error: by parameter, its possible change by a model error as large as the lack of fit
            (`rig.fitter.misfit`); None if lack of fit is not significant or cannot be tested.
        drifts: whether the parameters still vary significantly between replications.
        blind: reason why T_bias can miss a lack of fit; "" if there is none.
    """

    T_bias: float
    F_bias_95: float
    sigma_bias_deg: float
    model_error: Mapping[str, float] | None = None
    drifts: bool = False
    blind: str = ""

    def sentence(self, sensor: str) -> str:
        """Notes for readers of the parameters."""
        if not isfinite(self.T_bias):
            return f"whether lack of fit is left in {sensor} cannot be tested with these data"
        test = f"T_bias {self.T_bias:.3g}, 95 % limit {self.F_bias_95:.3g}"
        if self.model_error is None:
            found = f"no significant lack of fit is left in {sensor} ({test})"
            return f"{found}; {self.blind}" if self.blind else found
        moves = ", ".join(
            f"{name.partition('_')[0]} by up to {value:.2g} {'V/g' if name == 'S_V' else name.partition('_')[2]}"
            for name, value in self.model_error.items()
            if name not in ("mx_V", "my_V", "mz_V")
        )
        left = f"{self.sigma_bias_deg:.2g} deg rms; {test}"
        found = f"lack of fit is left in {sensor} ({left}): parameters can be off: {moves}"
        return f"{found}; {self.blind}" if self.blind else found

    def to_dict(self) -> dict[str, Any]:
        """JSON values; missing numbers are None."""
        numbers = {name: getattr(self, name) for name in ("T_bias", "F_bias_95", "sigma_bias_deg")}
        return {
            **{name: value if isfinite(value) else None for name, value in numbers.items()},
            "model_error": None if self.model_error is None else dict(self.model_error),
            "drifts": self.drifts,
            "blind": self.blind,
        }

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Misfit:
        """Restore from `to_dict`."""
        known = {
            name: float("nan") if given[name] is None else float(given[name])
            for name in ("T_bias", "F_bias_95", "sigma_bias_deg")
        }
        error = given["model_error"]
        moved = None if error is None else {str(name): float(value) for name, value in error.items()}
        return cls(**known, model_error=moved, drifts=bool(given["drifts"]), blind=str(given.get("blind", "")))

    def widened(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """A parameter table whose intervals include the model error.

        In a widened row `interval95_of_scatter` is the original interval, and `model_error` the move of each end.
        """
        out = {name: dict(row) for name, row in table.items()}
        for name, error in (self.model_error or {}).items():
            pair = out[name]["interval95"] if name in out else None
            if pair is not None and None not in pair:
                out[name] |= {
                    "interval95": [pair[0] - error, pair[1] + error],
                    "interval95_of_scatter": list(pair),
                    "model_error": error,
                }
        return out
