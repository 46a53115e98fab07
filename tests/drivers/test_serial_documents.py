"""docs/reference/instruments.md lists every option of every serial driver with its default."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rig.drivers.keysight_34401a import Keysight34401A
from rig.drivers.keysight_34970a import Keysight34970A
from rig.drivers.newport_esp301 import NewportESP301

TEXT = (Path(__file__).parents[2] / "docs" / "reference" / "instruments.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("driver", [NewportESP301, Keysight34401A, Keysight34970A])
def test_options_are_documented(driver):
    for name, field in driver.Options.model_fields.items():
        default = "required" if field.is_required() else f"`{json.dumps(field.default)}`"
        assert f"| `{name}` | {default} | {field.description} |" in TEXT
