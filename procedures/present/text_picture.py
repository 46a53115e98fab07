"""A shape without a name as a few lines of text, for terminals and notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rig.fitter.rounding import with_error

_STEPS = "▁▂▃▄▅▆▇█"
_NOTHING = "·"
"""Where the 95 % band holds zero."""
_WIDE, _LINES = 26, 7
"""Characters of a line at least, as far as whole ones for each value go; lines at most."""
_Z = 1.96


def picture(shape: Mapping[str, Any]) -> Iterator[str]:
    """One line for a curve, one for each value of the second variable of a surface, and one that explains them.

    Heights go from the lowest to the highest estimate; a dot stands where the shape may be zero.

    Args:
        shape: its JSON.

    """
    over, beside, estimate, stderr = shape["over"], shape["beside"], shape["estimate"], shape["stderr"]
    low, high = min(estimate), max(estimate)
    x = sorted(set(over["x"]))
    seconds = [None] if beside is None else sorted(set(beside["x"]), reverse=True)
    cells = {
        (over["x"][k], None if beside is None else beside["x"][k]): (estimate[k], stderr[k])
        for k in range(len(estimate))
    }
    each = max(_WIDE // len(x), 1)
    every = -(-len(seconds) // _LINES)
    shown = seconds[::every]
    labels = ["" if one is None or beside is None else _titled(beside, f"{one:.3g}") for one in shown]
    left = max(map(len, labels))
    for label, second in zip(labels, shown, strict=True):
        drawn = "".join(_cell(cells.get((one, second)), low, high) * each for one in x)
        yield f"{label:>{left}}  {drawn}".lstrip() if not left else f"{label:>{left}}  {drawn}"
    unit = f" {shape['unit']}" if shape["unit"] else ""
    band = _Z * sorted(stderr)[len(stderr) // 2]
    (lowest, _), (highest, half) = (with_error(end, band, sign=True) for end in (low, high))
    yield (
        f"{' ' * (left + 2) if left else ''}{over['label']} from {x[0]:.4g} to {_with_unit(over, f'{x[-1]:.4g}')}; "
        f"{_STEPS[0]} {lowest}, {_STEPS[-1]} {highest}{unit}, 95 % band +-{half}; {_NOTHING} may be zero"
    )


def _cell(value: tuple[float, float] | None, low: float, high: float) -> str:
    if value is None:
        return " "
    estimate, stderr = value
    if abs(estimate) <= _Z * stderr:
        return _NOTHING
    return _STEPS[min(int((estimate - low) / (high - low) * len(_STEPS)), len(_STEPS) - 1)] if high > low else _STEPS[0]


def _titled(axis: Mapping[str, Any], value: str) -> str:
    return f"{axis['label']} {_with_unit(axis, value)}"


def _with_unit(axis: Mapping[str, Any], value: str) -> str:
    return f"{value} {axis['unit']}" if axis["unit"] else value
