"""The catalogue of effects and the standard models, for `rig explain`."""

from __future__ import annotations

import math

from rig.procedures.general.effects import TABLE_CATALOGUE
from rig.procedures.general.models import standard_models
from rig.procedures.present.catalogue_table import once
from rig.procedures.present.markdown import table


def explained(topic: str) -> str:
    """The catalogue for `rig explain effects`, the standard models for `rig explain models`."""
    return {"effects": catalogue, "models": models}[topic]()


def catalogue() -> str:
    """Kinds of effects; *a* and *b* stand for columns of a table."""
    words, first = {"y": "the response"}, dict[str, str]()
    kinds = [one for kind in TABLE_CATALOGUE for one in (kind, *kind.called.values(), kind.beside) if one is not None]
    rows = [
        (
            f"`{one.name}`" + (f" (`{one.warm}`)" if one.warm else ""),
            one.cause.format("*a*", "*b*", **words),
            one.of,
            once(first, one.name, one.separate_by.format("*a*", "*b*", **words)),
        )
        for one in kinds
    ]
    return f"## Tables of any kind\n\n{table(('kind', 'cause', 'in', 'what separates it'), dict.fromkeys(rows))}"


def models() -> str:
    """Standard models, and the sources of each group once."""
    rows, sources, others = [], dict[str, list[str]](), set()
    for name, model in standard_models().items():
        group, _, degree = name.rpartition("-")
        if name.startswith("thermocouple-") and degree.isdigit():
            others.add(group)
            continue
        sources.setdefault(model.source, []).append(name)
        low, high = model.valid
        valid = "any" if low == -math.inf else f"{low:.10g} to {high:.10g} {model.abscissa.unit}"
        variable, response = f"{model.abscissa.name}, {valid}", f"{model.response.name}, {model.response.unit}"
        rows.append([f"`{name}`", model.title, variable, response])
    for row in rows:
        group = row[0].strip("`")
        row[0] += f" (also `{group}-0`, `-1`, `-3`)" if group in others else ""
    said = "".join(f"- {', '.join(f'`{name}`' for name in names)}: {source}\n" for source, names in sources.items())
    return table(("`--model`", "equation", "abscissa, valid range", "response"), rows) + "\nSources:\n\n" + said
