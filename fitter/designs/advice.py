"""Shortcomings of a design in sentences, for a plan that a person reads before the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rig.fitter.designs.evaluate import Evaluation
from rig.fitter.designs.optimal import Design

CORRELATED = 0.99
"""Correlation from which two coefficients are hardly told apart."""
FEW = 3
"""Degrees of freedom below which an estimated error is uncertain by a factor of about two or more."""
RARE = 3
"""Starts that reached the best design, up to which a longer search is suggested."""


def advice(design: Evaluation | Design, factors: Sequence[str]) -> tuple[str, ...]:
    """Sentences on terms that are undetermined or nearly confounded, missing degrees of freedom, and a short search.

    Args:
        design: an evaluation, or the result of a search.
        factors: names of the k factors, with units.
    """
    e = design.evaluation if isinstance(design, Design) else design
    found = [*_undetermined(e, factors), *_confounded(e), *_freedom(e)]
    if isinstance(design, Design) and design.reached <= RARE < design.starts:
        found.append(
            f"only {design.reached} of {design.starts} random starts ended at the best design; "
            "another seed or more starts may find a better one"
        )
    return tuple(found)


def _undetermined(e: Evaluation, factors: Sequence[str]) -> Iterator[str]:
    if e.undetermined:
        points = "; ".join(
            ", ".join(f"{name} = {x:g}" for name, x in zip(factors, p, strict=True)) for p in e.would.tolist()
        )
        terms, more = ", ".join(e.undetermined), _count(len(e.would), "more point", "more points")
        yield f"the design does not determine {terms}; with {more} it would: {points}"


def _confounded(e: Evaluation) -> Iterator[str]:
    pairs = [(a, b, r) for a, b, r in e.correlated(CORRELATED) if "1" not in (a, b)]
    if pairs:
        listed = ", ".join(f"{a} and {b} ({r:+.3f})" for a, b, r in pairs[:3])
        more = f" and {len(pairs) - 3} more pairs" if len(pairs) > 3 else ""
        yield f"coefficients are nearly confounded: {listed}{more}; a wider range would separate them"


def _freedom(e: Evaluation) -> Iterator[str]:
    f = e.freedom
    if f.residual < FEW:
        yield f"{_left(f.residual)} for the error of a point: add points"
    if f.whole_plots is not None and f.whole_plots < FEW:
        yield f"{_left(f.whole_plots)} for the error between whole plots: add whole plots"
    if f.pure_error == 0:
        yield "no point is repeated, so that lack of fit cannot be tested against pure error"
    elif f.lack_of_fit == 0:
        yield "there are as many distinct points as terms, so that nothing can show that the model lacks a term"


def _left(df: int) -> str:
    return f"{_count(max(df, 0), 'degree', 'degrees')} of freedom {'is' if df == 1 else 'are'} left"


def _count(n: int, one: str, many: str) -> str:
    number = {0: "no", 1: "one"}.get(n, str(n))
    return f"{number} {one if n == 1 else many}"
