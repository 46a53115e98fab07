"""The controller: benches, the sequencer, the run file, recovery, the closed loop, the command line.

`import rig` is also the Python interface (docs/how_to/python.md): names in `__all__` are public, and loaded at their
first use.
"""

TYPE_CHECKING = False  # as in `typing`, which `rig --help` need not load
if TYPE_CHECKING:
    from typing import Any

    from procedures.errors import DataError
    from rig.errors import BenchFault, BusyError, ConfigurationError, RigError, RunFileError, StorageError, UsageError
    from rig.results.budget import Budget, budget
    from rig.results.charts import ControlChart, chart
    from rig.results.data import Calibration, Data, Trace, open  # noqa: A004 - rig.open, like the built-in open
    from rig.results.inferred import Inferred, infer
    from rig.results.observations import Observations
    from rig.results.planned import Plan, plan
    from rig.results.result import Plots, Result
    from rig.results.run import Run, run

__all__ = [
    "BenchFault",
    "Budget",
    "BusyError",
    "Calibration",
    "ConfigurationError",
    "ControlChart",
    "Data",
    "DataError",
    "Inferred",
    "Observations",
    "Plan",
    "Plots",
    "Result",
    "RigError",
    "Run",
    "RunFileError",
    "StorageError",
    "Trace",
    "UsageError",
    "budget",
    "chart",
    "infer",
    "open",
    "plan",
    "run",
]

_WHERE = {
    "rig.results.budget": ("Budget", "budget"),
    "rig.results.charts": ("ControlChart", "chart"),
    "rig.results.data": ("Calibration", "Data", "Trace", "open"),
    "rig.results.inferred": ("Inferred", "infer"),
    "rig.results.observations": ("Observations",),
    "rig.results.planned": ("Plan", "plan"),
    "rig.results.result": ("Plots", "Result"),
    "rig.results.run": ("Run", "run"),
    "procedures.errors": ("DataError",),
    "rig.errors": (
        "BenchFault",
        "BusyError",
        "ConfigurationError",
        "RigError",
        "RunFileError",
        "StorageError",
        "UsageError",
    ),
}
"""Module of every public name."""


def __getattr__(name: str) -> "Any":
    """A public name, or `__version__`; loaded at its first use, after `rig.__main__` handles interrupts."""
    if name == "__version__":
        from rig.version import VERSION  # noqa: PLC0415

        return VERSION
    for module, names in _WHERE.items():
        if name in names:
            from importlib import import_module  # noqa: PLC0415

            globals()[name] = getattr(import_module(module), name)
            return globals()[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
