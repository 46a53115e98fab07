"""`certificate.toml`: what a laboratory settles once for its certificates."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Literal, Self

from pydantic import Field, model_validator

from rig.bench.config import parse_toml, read_text, validated
from rig.fitter.decision import GuardBand, ProbabilityLimit, Rule, SharedRisk, SimpleAcceptance
from rig.procedures.plan.settings import Strict
from rig.verbs.certificate.tolerances import ToleranceSettings

_COUNTRY = r"^[A-Z]{2}$"


class DecisionSettings(Strict):
    """`[decision]`: the rule by which conformity is stated, agreed with the customer."""

    rule: Literal["simple", "guard-band", "probability", "shared-risk"] = Field(
        "guard-band",
        description="simple acceptance, acceptance limits inside the tolerance, a probability of conformity, or simple "
        "acceptance where the uncertainty is small enough",
    )
    factor: float = Field(1.0, description="guard-band: the band is this times the expanded uncertainty")
    binary: bool = Field(False, description="guard-band: pass or fail only, without conditional statements")
    probability: float = Field(0.95, gt=0.5, lt=1, description="probability: least probability of a statement")
    largest_share: float = Field(
        1 / 3, gt=0, le=1, description="shared-risk: largest share of the expanded uncertainty in half the tolerance"
    )

    @property
    def made(self) -> Rule:
        """The rule."""
        rules: dict[str, Rule] = {
            "simple": SimpleAcceptance(),
            "guard-band": GuardBand(self.factor, self.binary),
            "probability": ProbabilityLimit(self.probability),
            "shared-risk": SharedRisk(self.largest_share),
        }
        return rules[self.rule]

    @property
    def words(self) -> str:
        """The rule, for people."""
        side = "inside" if self.factor >= 0.0 else "outside"
        band = f"{side} the tolerance by {abs(self.factor):g} times the expanded uncertainty"
        ends = "pass or fail" if self.binary else "conditional statements within the band on either side of a limit"
        return {
            "simple": "simple acceptance: a value inside the tolerance passes (JCGM 106, 8.2)",
            "guard-band": f"acceptance limits {band}; {ends} (JCGM 106, 8.3)",
            "probability": f"a pass needs a probability of conformity of {100 * self.probability:g} % at least, a "
            f"fail a probability of nonconformity of as much (JCGM 106, 7)",
            "shared-risk": f"simple acceptance where the expanded uncertainty is at most {self.largest_share:.2g} of "
            f"half the tolerance; otherwise no statement",
        }[self.rule]


class MethodSettings(Strict):
    """`[method]`: name and number of the method, how it works, and what it follows."""

    name: str = Field("", description="name and number of the calibration method")
    sentences: tuple[str, ...] = Field((), description="how it works")
    references: tuple[str, ...] = Field((), description="standards and papers")


class TableSettings(Strict):
    """`[table]`: what a run file would say, for a certificate of a CSV table."""

    began: datetime.date = Field(description="first day of the measurement")
    ended: datetime.date | None = Field(None, description="last day; left out: the first one")
    models: dict[str, str] = Field(
        min_length=1,
        description='declared model of each output, by its column: `cell_V = "1 + force_kN"`; the item is '
        "`sensors.cell` of the register",
    )
    given_by: dict[str, str] = Field(
        default_factory=dict,
        description='equipment that reads or sets each column, by its key in the register: `force_kN = "W-10"`',
    )
    room: tuple[str, ...] = Field(
        (), description="columns that recorded the room in which the equipment stands: `room_degC`, `humidity_pct`"
    )
    keep: tuple[int, ...] = Field(
        (), description="rows that the search for gross errors names and that stay in the results, after you looked"
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.ended is not None and self.ended < self.began:
            raise ValueError(f"ended = {self.ended} is before began = {self.began}: correct one")
        return self


class ConformitySettings(Strict):
    """What conformity is judged by: as a run file keeps it from before its first observation."""

    decision: DecisionSettings = DecisionSettings()
    tolerance: tuple[ToleranceSettings, ...] = ()


class CertificateSettings(Strict):
    """A whole `certificate.toml`."""

    number: str = Field(
        "{year}-{next:04d}",
        pattern=r"^[^/\\\x00-\x1f]*\{next(:0\d+d)?\}[^/\\\x00-\x1f]*$",
        description="number of a certificate; `{year}` is that of issue, `{next}` the first number that the laboratory "
        "has not issued, and that has no certificate in the output folder; of a simulated run it begins with `SIM-` "
        "and has a count of its own",
    )
    numbers: str = Field(
        "issued.json",
        min_length=1,
        description="register of the certificates that the laboratory has issued: a file beside this one",
    )
    country: str = Field("", pattern=f"{_COUNTRY}|^$", description="country of the laboratory, ISO 3166-1: `GB`")
    email: str = ""
    phone: str = ""
    logo: str = Field("", description="picture (SVG, PNG or JPEG), a file beside this one")
    paper: Literal["a4", "letter"] = "a4"
    template: str = Field("", description="own template in typst, a file beside this one")
    fonts: str = Field(
        "", description="folder beside this file with fonts for texts that are not Latin, Greek or Cyrillic"
    )
    place: str = Field("", description="where the calibration is made; left out: the laboratory's address")
    item: str = Field("", description="what the items are: `Load cell, 10 kN`")
    customer_country: str = Field("", pattern=f"{_COUNTRY}|^$", description="country of the customer, ISO 3166-1")
    calibrated_by: str = Field("", description="who calibrates; left out: the operators of the run")
    calibrated_by_role: str = "calibration"
    approved_by: str = Field("", description="who approves the certificate")
    approved_by_role: str = "approval"
    at: tuple[dict[str, float], ...] = Field(
        (), description="points of the results, such as `{ force_kN = 2 }`; left out: those of the kind"
    )
    probability: float = Field(0.95, gt=0.5, lt=1, description="coverage probability of expanded uncertainties")
    same_meter: bool = Field(False, description="whether the meter of the run reads the sensors in use as well")
    annex: Literal["largest", "all", "none"] = Field(
        "largest",
        description="budgets in the annex: that of the largest uncertainty of every sort of result, or all",
    )
    customer_wants_due_date: bool = Field(False, description="whether the customer asked for a date")
    next_due: datetime.date | None = Field(None, description="date of the next calibration, if the customer wants one")
    remarks: tuple[str, ...] = ()
    method: MethodSettings = MethodSettings()
    decision: DecisionSettings = DecisionSettings()
    tolerance: tuple[ToleranceSettings, ...] = ()
    table: TableSettings | None = None

    @model_validator(mode="after")
    def _due(self) -> Self:
        if self.next_due is not None and not self.customer_wants_due_date:
            raise ValueError(
                "next_due: a certificate recommends no date unless the customer wants one (ISO/IEC 17025, 7.8.4.3): "
                "add customer_wants_due_date = true, or leave it out"
            )
        if self.customer_wants_due_date and self.next_due is None:
            raise ValueError("customer_wants_due_date = true needs next_due = YYYY-MM-DD")
        return self


def read_settings(path: Path) -> CertificateSettings:
    """Settings from their file. Raises `ConfigurationError` with all defects."""
    text = read_text(path, "certificate")
    return validated(CertificateSettings, parse_toml(text, str(path)), str(path))
