"""Meaning of a Druck PACE's numbers: unit, control range, reference of pressures, and the atmosphere.

All of it is asked of the controller at every use, because anybody may change it at the front panel. The name of a
control range consists of its full scale, its unit, and the reference of pressures (K0472, :INST:CAT:ALL?): "15.00psia",
"3.50barg", "1600HPAG".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

from rig.drivers.druck_options import PaceOptions
from rig.drivers.druck_scpi import PaceScpi
from rig.drivers.errors import BadReply

PASCALS = {
    "PSI": 6894.757293168,
    "BAR": 1e5,
    "MBAR": 100.0,
    "HPA": 100.0,
    "KPA": 1e3,
    "MPA": 1e6,
    "PA": 1.0,
    "TORR": 101325.0 / 760.0,
    "MMHG": 133.322387415,
}
"""Units of readings, in pascals: somebody may change the unit at the front panel."""

_REFERENCES = {"A": "absolute", "G": "gauge", "D": "differential"}


def full_scale_psi(name: str) -> float | None:
    """Full scale of a range, psi; None if the name does not contain it.

    Args:
        name: as the instrument gives it; upper and lower case are equivalent.
    """
    found = _parts(name)
    return None if found is None else float(found[0]) * PASCALS[found[1]] / PASCALS["PSI"]


@lru_cache(maxsize=64)  # every reading asks for it
def reference_of(name: str) -> str:
    """Reference of its pressures: "absolute", "gauge", "differential", or "" if the name does not contain it."""
    found = _parts(name)
    letter = name.strip()[-1:].upper() if found is None else found[2]
    return _REFERENCES.get(letter, "")


def _parts(name: str) -> tuple[str, str, str] | None:
    """Number, unit, letter; the last letter may belong to the unit, as in mmHg and Pa."""
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Z0-9]+?)\s*", name.upper())
    if match is None:
        return None
    number, rest = match.groups()
    if rest[:-1] in PASCALS and rest[-1] in _REFERENCES:
        return number, rest[:-1], rest[-1]
    return (number, rest, "") if rest in PASCALS else None


_ATMOSPHERE_PSI = (6.5, 16.5)  # from the highest towns to the deepest mines
_BELOW_VACUUM_PSI = -0.5  # no zero error of a sensor is as large
_BEYOND = 1.1  # a range ends a little above its nominal full scale


@dataclass(frozen=True)
class Scale:
    """One unit of the controller in psi, the absolute pressure of its 0 in psi, and the control range's name."""

    unit_psi: float
    zero_psia: float
    range: str

    def psia(self, told: float) -> float:
        """A number of the controller as an absolute pressure, psi."""
        return told * self.unit_psi + self.zero_psia


class Measures:
    """Units and ranges of one control module. Raises `BadReply` for contradictions with the bench or within its
    answers.

    Args:
        pace: questions and commands.
        where: the instrument, for messages.
        options: of the bench file.

    Attributes:
        unit: header of its unit.
        source: header of the controlled quantities.
        sense: header of the measured quantities.
        no_air: defect of its barometer, one sentence or none.
    """

    def __init__(self, pace: PaceScpi, where: str, options: PaceOptions) -> None:
        self._pace, self._where, self._options = pace, where, options
        suffix = "" if options.module == 1 else "2"
        self.unit, self.source, self.sense = f":UNIT{suffix}:PRES", f":SOUR{suffix}:PRES", f":SENS{suffix}:PRES"
        self.no_air: tuple[str, ...] = ()
        self._has_barometer = False  # whether it has given an atmospheric pressure
        self._range: str | None = None  # the control range's name at preparation

    def set_unit(self) -> None:
        """Set the unit of this module and read it back: slew and setpoints are numbers in it."""
        self._pace.send(f"{self.unit} PSI")
        self.check_unit()

    def check_unit(self) -> None:
        """Refuse another unit of this module than psi."""
        if (answer := self._pace.ask(f"{self.unit}?")).upper() != "PSI":
            raise BadReply(
                f"{self._where}: module {self._options.module} was set to PSI and says {answer!r}; "
                f"{self.unit}? asks for it"
            )

    def accept_range(self) -> str:
        """Check the control range against bench and unit, and refuse any other range from now on; its name."""
        self._range = self._checked_range()
        return self._range

    def selected_range(self) -> str:
        """Name of the control range; it contains the full scale and the reference of pressures."""
        return self._pace.ask(f"{self.source}:RANG?").strip('"')

    def _unit_psi(self) -> float:
        """The present unit: somebody may have changed it at the front panel."""
        name = self._pace.ask(f"{self.unit}?")
        if name.upper() not in PASCALS:
            raise BadReply(f"{self._where} is set to the unknown unit {name!r}; set it to PSI")
        return PASCALS[name.upper()] / PASCALS["PSI"]

    def scale(self) -> Scale:
        """Present meaning of the controller's numbers, by its unit and its control range's name."""
        unit, name = self._unit_psi(), self.selected_range()
        gauge = (reference_of(name) or self._options.reference) == "gauge"
        return Scale(unit, self._barometer(unit) if gauge else 0.0, name)

    def refuse_below_vacuum(self, psia: float) -> None:
        """Raise `BadReply` for a pressure below zero."""
        if psia < _BELOW_VACUUM_PSI:
            raise BadReply(
                f"{self._where}: it reads {psia:.4g} psia, less than a vacuum; look at its sensor, its zero, and "
                f"the reference of the control range"
            )

    def checked_scale(self) -> Scale:
        """Present meaning of its numbers in the prepared control range, whose limits were checked.

        Raises:
            BadReply: another control range is selected.
        """
        scale = self.scale()
        told, wanted = reference_of(scale.range), self._options.reference
        if told != wanted or self._range not in (None, scale.range):
            before = "the bench says" if self._range is None else f"it was {self._range!r} when it was prepared,"
            raise BadReply(
                f"{self._where}: the control range is {scale.range!r} ({told or 'reference unknown'}); "
                f"{before} reference = {wanted!r}; select the former range again at the front panel"
            )
        return scale

    def refuse_unknown_zero(self) -> None:
        """Refuse a gauge setpoint if the atmospheric pressure is unknown."""
        if self._options.reference == "gauge" and self.no_air:
            raise BadReply(f"{self._where}: no gauge pressure is set while {self.no_air[0]}")

    def atmosphere(self) -> float:
        """Present pressure of the atmosphere, psi."""
        return self._barometer(self._unit_psi())

    def _barometer(self, unit_psi: float) -> float:
        """Pressure of the atmosphere, psi; from the bench file if there is no barometer, which then reads 0.

        A barometer with an impossible reading is not used, and `read` reports it. This includes 0 if it has given an
        atmospheric pressure before, or if gauge pressures need it and the bench has no `ambient_psia`.
        """
        told = self._pace.number(f"{self.sense}:BAR?") * unit_psi
        if _ATMOSPHERE_PSI[0] <= told <= _ATMOSPHERE_PSI[1]:
            self._has_barometer, self.no_air = True, ()
            return told
        needed = self._options.reference == "gauge" and not self._air_is_given()
        self.no_air = (
            (f"the barometer reads {told:.4g} psi, which cannot be the atmosphere; ambient_psia is used instead",)
            if told or self._has_barometer or needed
            else ()
        )
        return self._options.ambient_psia

    def _air_is_given(self) -> bool:
        return "ambient_psia" in self._options.model_fields_set

    def _checked_range(self) -> str:
        """The control range's name. Raises `BadReply` if range, barometer or pressure contradict the bench or the
        unit.
        """
        where, options = self._where, self._options
        name = self.selected_range()
        reference, full_scale = reference_of(name), full_scale_psi(name)
        if reference != options.reference:
            unknown = "" if reference else ", whose name does not end in a (absolute) or g (gauge)"
            raise BadReply(
                f"{where}: the control range is {name!r}{unknown}, but the bench says "
                f"reference = {options.reference!r}; give `control_range`, or correct `reference`"
            )
        if options.control_range is not None and name.upper() != options.control_range.upper():
            raise BadReply(f"{where}: the control range {options.control_range!r} was selected and it says {name!r}")
        air = self._pace.number(f"{self.sense}:BAR?")
        if air and not _ATMOSPHERE_PSI[0] <= air <= _ATMOSPHERE_PSI[1]:
            raise BadReply(
                f"{where}: its barometer reads {air:g} and it says it is set to PSI: that cannot be the atmosphere; "
                f"look at the unit of module {options.module} on its display"
            )
        if not air and options.reference == "gauge" and not self._air_is_given():
            raise BadReply(
                f"{where}: its barometer reads 0, and gauge pressures are relative to the atmosphere; "
                f"give `ambient_psia`, the pressure of the atmosphere at its place"
            )
        pressure = self._pace.number(f"{self.sense}?")
        if options.reference == "absolute":
            self.refuse_below_vacuum(pressure)
        if full_scale is None:
            return name
        if not -_BEYOND * max(full_scale, _ATMOSPHERE_PSI[1]) <= pressure <= _BEYOND * full_scale + _ATMOSPHERE_PSI[1]:
            raise BadReply(
                f"{where}: it reads {pressure:g} and says it is set to PSI, but its control range {name!r} ends at "
                f"{full_scale:g} psi; look at the unit of module {options.module} on its display"
            )
        highest = full_scale + (self._barometer(1.0) if options.reference == "gauge" else 0.0)
        if options.high_psia > _BEYOND * highest:
            raise BadReply(
                f"{where}: the bench says high_psia = {options.high_psia:g}, but the control range {name!r} ends at "
                f"{highest:.4g} psia; give `control_range`, or correct `high_psia`"
            )
        return name
