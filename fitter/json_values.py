"""What JSON can hold."""

from __future__ import annotations

JsonValue = float | int | str | None | list["JsonValue"] | dict[str, "JsonValue"]
