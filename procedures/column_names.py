"""Names of columns: a stem and a unit, such as `force_kN`. A unit may have "per": `flow_m3_per_h`, `out_mV_per_V`."""

from __future__ import annotations


def split_unit(name: str) -> tuple[str, str]:
    """Stem and unit of a column's name; an empty stem if it has one word only."""
    words = name.split("_")
    taken = 3 if len(words) > 3 and words[-2] == "per" else 1
    return "_".join(words[:-taken]), "_".join(words[-taken:])


def stem_of(name: str) -> str:
    """A column's name without its unit."""
    return split_unit(name)[0]


def unit_of(name: str) -> str:
    """The unit at the end of a column's name."""
    return split_unit(name)[1]


def with_word(name: str, word: str) -> str:
    """A column's name with a word before its unit: `pressure_set_psia`."""
    stem, unit = split_unit(name)
    return f"{stem}_{word}_{unit}"


def since_of(name: str) -> str:
    """The column with the seconds that a factor had stood at its setting when it was read: `force_since_s`."""
    return f"{stem_of(name) or name}_since_s"


def came_from(name: str) -> str:
    """The column with the setting from which a factor came to its own: `force_from_kN`."""
    return with_word(name, "from")


def moves_of(name: str) -> tuple[str, str]:
    """The columns that say how a factor came to its setting: how long it had stood, and what it came from."""
    return since_of(name), came_from(name)


def read_at(name: str) -> str:
    """The column with the elapsed time at which an output was read, where that is not the time of the row."""
    return f"{stem_of(name) or name}_elapsed_s"


def beside(name: str) -> tuple[str, ...]:
    """Columns that say how or when a value came about: they are no quantities that a reading may depend on."""
    return (*moves_of(name), read_at(name))


def spelled(unit: str) -> str:
    """A unit as people write it: `m3_per_h` is `m3/h`."""
    return unit.replace("_per_", "/")
