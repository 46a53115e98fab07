"""Settings of a CiA 402 drive: the bench's options, the objects in its EDS, and their units.

Many objects of CiA 402 are optional. An object missing in the EDS is not used, and a remark names the consequence.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Literal

from canopen.objectdictionary import ObjectDictionary
from pydantic import BaseModel, Field, ValidationInfo, field_validator, model_validator

from rig.drivers.cia402_units import Quantity, Unit, parse_unit, told_unit
from rig.drivers.errors import BadReply, InstrumentError
from rig.drivers.wires.can_node import CanNode, has_object, read_eds

FOLLOWING, WINDOW, WINDOW_TIME, VELOCITY, SOFTWARE_LIMITS = 0x6065, 0x6067, 0x6068, 0x606C, 0x607D
SPEED, ACCELERATION, DECELERATION, QUICK_STOP = 0x6081, 0x6083, 0x6084, 0x6085
HOME_METHOD, HOME_SPEEDS, HOME_ACCELERATION = 0x6098, 0x6099, 0x609A
ENCODER_RESOLUTION, GEAR_RATIO, FEED = 0x608F, 0x6091, 0x6092
HOME_OFFSET, POLARITY = 0x607C, 0x607E
ERROR_CODE = 0x603F
_UNIT_OBJECTS: dict[Quantity, int] = {"velocity": 0x60A9, "acceleration": 0x60AA}

_MEANINGS = (
    *((index, subindex) for index in (ENCODER_RESOLUTION, GEAR_RATIO, FEED) for subindex in (1, 2)),
    *((index, 0) for index in (HOME_OFFSET, POLARITY, 0x60A8, *_UNIT_OBJECTS.values())),
)

_NEEDED = (0x1000, 0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x607A, SPEED, ACCELERATION)
"""Without these objects there is no profile position mode."""

_COSTS: dict[tuple[int, int], str] = {
    (ERROR_CODE, 0): "a fault is reported without its code; look at the drive's display",
    (FOLLOWING, 0): "following_error_deg is not used: the drive's own following error window applies",
    (WINDOW, 0): "this program judges whether a target is reached, by in_position_deg and in_position_s",
    (WINDOW_TIME, 0): "this program judges whether a target is reached, by in_position_deg and in_position_s",
    (VELOCITY, 0): "only bit 10 of the statusword shows standstill after a stop",
    (SOFTWARE_LIMITS, 1): "the drive has no limits of its own: only this program enforces pitch_deg and roll_deg",
    (DECELERATION, 0): "it brakes with the drive's own deceleration, not acceleration_deg_per_s2",
    (QUICK_STOP, 0): "a quick stop brakes with the drive's own deceleration, not four times that of a move",
    (HOME_METHOD, 0): "home_method is not used: the drive's own homing method applies",
    (HOME_SPEEDS, 1): "home_speed_deg_per_s is not used: the drive's own homing speed applies",
    (HOME_ACCELERATION, 0): "the home search has the drive's own acceleration",
}
"""The consequence of a missing or read-only object, by (index, subindex)."""

_SUPPLIED = (0x0, 0x402)
_COUNTS_PER_DEGREE = 36000.0  # of the supplied EDS
_READ_ONLY = (ERROR_CODE, VELOCITY)
_COARSE = 0.01  # relative change by rounding above which a remark is made; chosen
_SAME = 1e-3  # relative difference of two statements of one ratio, each with its printed digits; chosen


class CiA402Options(BaseModel, extra="forbid"):
    """Options of this instrument in the bench file."""

    pitch_node: int = Field(1, ge=1, le=127, description="node of the pitch drive")
    roll_node: int = Field(2, ge=1, le=127, description="node of the roll drive")
    counts_per_degree: float = Field(
        _COUNTS_PER_DEGREE, gt=0, description="encoder counts per degree of the table; needed with another EDS"
    )
    velocity_unit: str | None = Field(
        None,
        description='unit of speed on the wire: "counts/s", "rpm", "rev/s", "deg/s"; default: 60A9h of the drive',
    )
    acceleration_unit: str | None = Field(
        None,
        description='unit of acceleration: "counts/s^2", "rpm/s", "rev/s^2", "deg/s^2"; default: 60AAh of the drive',
    )
    turns_per_table_turn: float | None = Field(
        None,
        gt=0,
        description="turns of the drive's shaft per turn of the table; for all units but counts",
    )
    speed_deg_per_s: float = Field(5.0, gt=0, le=80, description="speed of moves")
    acceleration_deg_per_s2: float = Field(5.0, gt=0, le=320, description="acceleration and deceleration of moves")
    home_method: int = Field(34, ge=-128, le=37, description="CiA 402 homing method; 34 goes to the index mark")
    home_speed_deg_per_s: float = Field(4.0, gt=0, le=40, description="speed of the home search")
    in_position_deg: float = Field(3e-4, gt=0, description="maximum distance from a reached target")
    in_position_s: float = Field(0.05, ge=0, le=60, description="minimum time within it")
    following_error_deg: float = Field(0.5, gt=0, description="following error at which the drive faults")
    homed_bit: Literal[0, 8, 14, 15] | None = Field(
        None,
        description="statusword bit that means homed; 0 if there is none, "
        "as with any other EDS than the supplied one, whose drives have bit 15",
    )
    pitch_deg: tuple[float, float] = Field((-190.0, 190.0), description="limits of pitch: lowest, highest")
    roll_deg: tuple[float, float] = Field((-190.0, 190.0), description="limits of roll: lowest, highest")
    timeout_s: float = Field(0.3, gt=0, description="maximum wait for an SDO reply")
    eds: str = Field(description="file with the drives' EDS, beside the bench file")

    @field_validator("eds")
    @classmethod
    def _readable(cls, text: str) -> str:
        dictionary = read_eds(text, 1)
        if missing := [f"{index:04X}h" for index in _NEEDED if not has_object(dictionary, index)]:
            raise ValueError(f"the EDS has no {', '.join(missing)}: the drive has no profile position mode")
        return text

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> CiA402Options:
        if self.pitch_node == self.roll_node:
            raise ValueError(f"pitch_node and roll_node are both {self.pitch_node}")
        for name, (low, high) in (("pitch_deg", self.pitch_deg), ("roll_deg", self.roll_deg)):
            if not low < high:
                raise ValueError(f"{name}: {low:g} is not below {high:g}")
            if max(-low, high) * self.counts_per_degree >= 2**31:
                raise ValueError(f"{name}: at {self.counts_per_degree:g} counts per degree it exceeds 32 bits")
        dictionary = read_eds(self.eds, 1)
        if (info.context or {}).get("stored"):
            self._as_before(dictionary)
        if "counts_per_degree" not in self.model_fields_set and not _supplied(dictionary):
            raise ValueError(
                "counts_per_degree is needed: the EDS is not the supplied one, for which there is a default"
            )
        declared: dict[Quantity, str | None] = {"velocity": self.velocity_unit, "acceleration": self.acceleration_unit}
        for quantity, text in declared.items():
            if text is not None:
                parse_unit(text, quantity)
            elif not has_object(dictionary, index := _UNIT_OBJECTS[quantity]):
                raise ValueError(
                    f"{quantity}_unit is needed: the EDS has no {index:04X}h for the unit in which the drives "
                    f"count {quantity}; look it up in their manual"
                )
        return self

    def _as_before(self, dictionary: ObjectDictionary) -> None:
        """Warn about an assumption of earlier versions; a drive that reports something else is refused nevertheless."""
        if "counts_per_degree" not in self.model_fields_set:
            self.counts_per_degree = _COUNTS_PER_DEGREE
        if self.velocity_unit is None and not has_object(dictionary, _UNIT_OBJECTS["velocity"]):
            self.velocity_unit = "counts/s"
        if self.acceleration_unit is None and not has_object(dictionary, _UNIT_OBJECTS["acceleration"]):
            self.acceleration_unit = "counts/s^2"


def lacking(dictionary: ObjectDictionary) -> tuple[str, ...]:
    """Required objects that are missing in the EDS, each with its consequence; () if none."""
    return tuple(
        f"the EDS has no {index:04X}h that can be {'read' if index in _READ_ONLY else 'set'}: {cost}"
        for (index, subindex), cost in _COSTS.items()
        if not has_object(dictionary, index, subindex, writable=index not in _READ_ONLY)
    )


def homed_bit(dictionary: ObjectDictionary, options: CiA402Options) -> int:
    """The statusword bit that means homed; 0 if there is none.

    CiA 402 does not define one. Makers use different bits with different meanings (closed loop, referenced, moving), so
    it is not guessed.
    """
    if options.homed_bit is not None:
        return options.homed_bit
    return 15 if _supplied(dictionary) else 0


def _supplied(dictionary: ObjectDictionary) -> bool:
    """Whether the EDS is `contracts/cia402_drive.eds`, by its device information."""
    device = dictionary.device_information
    return (device.vendor_number, device.product_number) == _SUPPLIED


def judged_here(dictionary: ObjectDictionary) -> bool:
    """Whether the drive has no adjustable target window, so that this program judges whether a target is reached."""
    return not all(has_object(dictionary, index, writable=True) for index in (WINDOW, WINDOW_TIME))


class Scales:
    """Conversion of the table's degrees, deg/s and deg/s^2 to one drive's units.

    Args:
        node: the drive, which is asked for its units.
        options: the bench's.

    Attributes:
        remarks: sentences about rounded values.

    Raises:
        BadReply: neither bench nor drive name a unit, or they contradict one another; the message names the bench key.
    """

    def __init__(self, node: CanNode, options: CiA402Options) -> None:
        self._where = node.where
        self._counts_per_degree = options.counts_per_degree
        velocity = _agreed(node, "velocity", options.velocity_unit)
        acceleration = _agreed(node, "acceleration", options.acceleration_unit)
        turns = _turns(node, options) if velocity.of_shaft or acceleration.of_shaft else 1.0
        self._velocity = (velocity, velocity.per_degree(options.counts_per_degree, turns))
        self._acceleration = (acceleration, acceleration.per_degree(options.counts_per_degree, turns))
        self.remarks: list[str] = []

    def counts(self, degrees: float) -> int:
        """A position in position units of the drive, from degrees."""
        return round(degrees * self._counts_per_degree)

    def velocity(self, what: str, deg_per_s: float) -> int:
        """A speed in units of the drive, from deg/s. Raises `BadReply` if the unit is too coarse."""
        return self._whole(what, deg_per_s, "deg/s", *self._velocity)

    def acceleration(self, what: str, deg_per_s2: float) -> int:
        """An acceleration in units of the drive, from deg/s^2. Raises `BadReply` if the unit is too coarse."""
        return self._whole(what, deg_per_s2, "deg/s^2", *self._acceleration)

    def _whole(self, what: str, wanted: float, unit: str, wire: Unit, per_degree: float) -> int:
        """A rounded value; rounded down with a remark if rounding changes it by more than a hundredth."""
        exact = wanted * per_degree
        value = round(exact)
        if abs(value - exact) > _COARSE * exact:
            value = int(exact)
            if value == 0:
                raise BadReply(
                    f"{self._where}: {what} = {wanted:g} {unit} is less than one {wire}, the unit of the drive; "
                    f"raise {what}, or set a finer unit in the drive"
                )
            said = f"{what} is {value / per_degree:.4g} {unit} instead of {wanted:g}: the drive counts in whole {wire}"
            if said not in self.remarks:
                self.remarks.append(said)
        return value


def settings_of(
    node: CanNode, scales: Scales, options: CiA402Options, limits: tuple[float, float]
) -> Iterator[tuple[int, int, int]]:
    """(index, subindex, value) of every available setting, in order."""
    acceleration, home = options.acceleration_deg_per_s2, options.home_speed_deg_per_s

    def a() -> int:
        return scales.acceleration("acceleration_deg_per_s2", acceleration)

    wanted: tuple[tuple[int, int, Callable[[], int]], ...] = (
        (SPEED, 0, lambda: scales.velocity("speed_deg_per_s", options.speed_deg_per_s)),
        (ACCELERATION, 0, a),
        (DECELERATION, 0, a),
        (QUICK_STOP, 0, lambda: scales.acceleration("four times acceleration_deg_per_s2", 4.0 * acceleration)),
        (FOLLOWING, 0, lambda: scales.counts(options.following_error_deg)),
        (WINDOW, 0, lambda: scales.counts(options.in_position_deg)),
        (WINDOW_TIME, 0, lambda: round(1000.0 * options.in_position_s)),
        (SOFTWARE_LIMITS, 1, lambda: scales.counts(limits[0])),
        (SOFTWARE_LIMITS, 2, lambda: scales.counts(limits[1])),
        (HOME_METHOD, 0, lambda: options.home_method),
        (HOME_SPEEDS, 1, lambda: scales.velocity("home_speed_deg_per_s", home)),
        (HOME_SPEEDS, 2, lambda: scales.velocity("a quarter of home_speed_deg_per_s", home / 4.0)),
        (HOME_ACCELERATION, 0, a),
    )
    for index, subindex, value in wanted:
        if node.has(index, subindex, writable=True):
            yield index, subindex, value()


def meanings_of(node: CanNode) -> dict[tuple[int, int], int]:
    """Present values of the objects that decide what positions and speeds mean, by (index, subindex).

    An object that the EDS has and the drive refuses is left out.
    """
    found = {}
    for key in _MEANINGS:
        if node.has(*key):
            with contextlib.suppress(InstrumentError):
                found[key] = node.number(*key)
    return found


def _agreed(node: CanNode, quantity: Quantity, declared: str | None) -> Unit:
    """The unit named by the bench file or by the drive."""
    index, key = _UNIT_OBJECTS[quantity], f"{quantity}_unit"
    code = node.number(index) if node.has(index) else 0
    told = told_unit(code, quantity)
    if declared is None:
        if told is None:
            says = (
                f"its {index:04X}h is {code:08X}h, which is unknown" if code else f"its {index:04X}h does not name one"
            )
            example = "rpm" if quantity == "velocity" else "rpm/s"
            raise BadReply(
                f"{node.where}: in which unit the drive counts {quantity} is not known ({says}); look it up "
                f'in its manual and write {key} = "{example}" (or what it is) into the bench file'
            )
        return told
    wanted = parse_unit(declared, quantity)
    if told is not None and told != wanted:
        raise BadReply(
            f"{node.where}: the bench file says {key} = {declared!r} and the drive's {index:04X}h ({code:08X}h) says "
            f"{told}; correct {key}, or leave it out"
        )
    return wanted


def _turns(node: CanNode, options: CiA402Options) -> float:
    """Turns of the drive's shaft per turn of the table."""
    told = _position_units_per_turn(node)
    derived = None if told is None else 360.0 * options.counts_per_degree / told
    declared = options.turns_per_table_turn
    if declared is None and derived is None:
        raise BadReply(
            f"{node.where}: the drive counts speeds at a shaft, and its turns per turn of the table are "
            f"unknown; write turns_per_table_turn = N in the bench file"
        )
    if declared is not None and derived is not None and abs(declared - derived) > _SAME * derived:
        raise BadReply(
            f"{node.where}: the bench file says turns_per_table_turn = {declared:g}; by counts_per_degree and the "
            f"{told:g} position units per turn of the drive (6092h, 608Fh) it is {derived:g}; correct one of them"
        )
    found = declared if declared is not None else derived
    assert found is not None
    return found


def _position_units_per_turn(node: CanNode) -> float | None:
    """By feed constant (6092h) or encoder resolution (608Fh); None if neither is set, or if there is a gear (6091h).

    With a gear, drives differ in the shaft at which they count speeds. A ratio of 1 or less is the default value of
    these objects.
    """
    ratios = [_ratio(node, index) for index in (GEAR_RATIO, FEED, ENCODER_RESOLUTION)]
    gear, feed, encoder = ratios
    if gear not in (None, 1.0):
        return None
    return next((ratio for ratio in (feed, encoder) if ratio is not None and ratio > 1.0), None)


def _ratio(node: CanNode, index: int) -> float | None:
    if not (node.has(index, 1) and node.has(index, 2)):
        return None
    over, under = node.number(index, 1), node.number(index, 2)
    return over / under if over > 0 and under > 0 else None
