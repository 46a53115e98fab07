"""Types of JSON values."""

from __future__ import annotations

JsonValue = float | int | str | None | list["JsonValue"] | dict[str, "JsonValue"]
