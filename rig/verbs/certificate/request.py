"""The contents of a certificate, as asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path

from rig.register.surroundings import Range
from rig.runs.certificate_fields import SETTINGS


@dataclass(frozen=True)
class CertificateRequest:
    """The contents of a certificate, as asked for.

    Attributes:
        runs: one run file, or CSV table, or two: as found, as left.
        issued: date of issue.
        equipment: another register than the one kept with the runs.
        settings: certificate.toml; None for that in the working folder.
        confirmed_by: later runs that confirm effects of the last run.
        calibrated_by: instead of that of the settings.
        approved_by: instead of that of the settings.
        adjustment: between as found and as left, a sentence.
        room: lowest and highest value of what the run did not record of the room, by name with unit, as the laboratory
            states it.
        traced: whether results are of the model with the effects that the trace finds, also where no further run
            confirmed them.
        today: the certificate of a real run is not dated after it; None if that is not asked.
        ignore: columns that the trace does not look at; those that `confirmed_by` recorded if there are none.
        added: files of replications that were added to the last run, in order.
    """

    runs: tuple[Path, ...]
    issued: date
    equipment: Path | None = None
    settings: Path | None = None
    confirmed_by: tuple[Path, ...] = ()
    calibrated_by: str = ""
    approved_by: str = ""
    adjustment: str = ""
    today: date | None = None
    traced: bool = False
    room: Mapping[str, Range] = field(default_factory=dict)
    added: tuple[Path, ...] = ()
    ignore: tuple[str, ...] = ()

    @property
    def settings_file(self) -> Path:
        """The file of the settings, whether it exists or not."""
        return self.settings or Path(SETTINGS)
