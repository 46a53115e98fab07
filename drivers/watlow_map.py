"""Register maps: a Modbus device's registers and codes as data."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Literal, Self

from pydantic import BaseModel, Field, model_validator

_WORDS = {"uint16": 1, "int32": 2, "float32": 2}


class RegisterEntry(BaseModel, extra="forbid", frozen=True):
    """One register of the map.

    Attributes:
        address: relative address.
        type: "uint16", "int32", "float32" or "text:N".
        access: "r" or "rw".
        stride: distance to the register of the next loop, alarm or module.
        codes: name of the table of its codes.
    """

    address: int = Field(ge=0, le=65535)
    type: str = Field(pattern=r"^(uint16|int32|float32|text:\d+)$")
    access: Literal["r", "rw"]
    stride: int = 0
    codes: str = ""

    @cached_property
    def words(self) -> int:
        """Number of its words."""
        kind, _, length = self.type.partition(":")
        return int(length) if length else _WORDS[kind]


class RegisterMap(BaseModel, extra="forbid", frozen=True):
    """A device's registers and codes; for a cascade, those of `cascade` replace others of the same name."""

    maker: str
    model: str
    word_order: Literal["low-first", "high-first"]
    registers: Mapping[str, RegisterEntry]
    cascade: Mapping[str, RegisterEntry] = Field(default_factory=dict)
    codes: Mapping[str, Mapping[str, int]]

    @model_validator(mode="after")
    def _told(self) -> Self:
        for name, entry in (*self.registers.items(), *self.cascade.items()):
            if entry.codes and entry.codes not in self.codes:
                raise ValueError(f"{name} has the codes of {entry.codes}, which are missing")
        return self


@lru_cache(maxsize=8)
def map_of(text: str) -> RegisterMap:
    """Read a register map from its TOML text."""
    return RegisterMap.model_validate(tomllib.loads(text))
