"""The register of equipment: what a laboratory knows of its instruments, standards and place, with uncertainties.

`equipment.toml` (docs/how_to/register.md) is referred to from the bench file by asset number, and kept in the run file.
"""

from rig.register.check import absent, check_register, check_validity, entries, unrecorded
from rig.register.equipment_file import Certificate, Equipment, Item, Laboratory, Register, SensorItem, Statement
from rig.register.needed import item_of, needed, stopping
from rig.register.read import DOCUMENT, parse_register, read_register, register_beside, register_of
from rig.register.stated import check_covered, stated_of
from rig.register.surroundings import KnownConditions, check_surroundings, holds_of

__all__ = [
    "DOCUMENT",
    "Certificate",
    "Equipment",
    "Item",
    "KnownConditions",
    "Laboratory",
    "Register",
    "SensorItem",
    "Statement",
    "absent",
    "check_covered",
    "check_register",
    "check_surroundings",
    "check_validity",
    "entries",
    "holds_of",
    "item_of",
    "needed",
    "parse_register",
    "read_register",
    "register_beside",
    "register_of",
    "stated_of",
    "stopping",
    "unrecorded",
]
