"""Twin of a source that a bench file describes: it moves the plant's source, its commands are the bench file's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rig.contracts.declared.exchanges import Tell
from rig.contracts.declared.roles import Source
from rig.sims.twin import Role
from rig.sims.twins.scpi_described import DescribedTwin


class DescribedSourceTwin(DescribedTwin):
    """A source: it moves the plant's source. Arguments as for `DescribedTwin`."""

    roles: ClassVar[frozenset[Role]] = frozenset({"source"})

    def role(self, options: Mapping[str, object]) -> dict[str, Any]:
        """Its source, as a table has it."""
        low, high = (float(str(options[key])) for key in ("low", "high"))
        within = float(str(options.get("tolerance") or (high - low) * 1e-6))
        on = (Tell(tell=str(options["on"])),) if options.get("on") else ()
        return {"source": Source.model_construct(low=low, high=high, tolerance=within, on=on)}
