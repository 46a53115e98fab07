"""The controller: benches, the sequencer, the run file, recovery, the closed loop, the command line.

`import rig` is also the Python interface (docs/how_to/python.md): names in `__all__` are public, and loaded at their
first use.
"""

TYPE_CHECKING = False  # as in `typing`, which `rig --help` need not load
if TYPE_CHECKING:
    from typing import Any

    from rig.errors import BenchFault, BusyError, ConfigurationError, RigError, RunFileError, StorageError, UsageError
    from rig.procedures.errors import DataError
    from rig.verbs.budget.result import Budget, budget
    from rig.verbs.chart.result import ControlChart, chart
    from rig.verbs.data.result import Calibration, Data, Trace, open  # noqa: A004 - rig.open, like the built-in open
    from rig.verbs.infer.result import Inferred, infer
    from rig.verbs.observations import Observations
    from rig.verbs.plan.result import Plan, plan
    from rig.verbs.result import Plots, Result
    from rig.verbs.run.result import Run, run

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
    "rig.verbs.budget.result": ("Budget", "budget"),
    "rig.verbs.chart.result": ("ControlChart", "chart"),
    "rig.verbs.data.result": ("Calibration", "Data", "Trace", "open"),
    "rig.verbs.infer.result": ("Inferred", "infer"),
    "rig.verbs.observations": ("Observations",),
    "rig.verbs.plan.result": ("Plan", "plan"),
    "rig.verbs.result": ("Plots", "Result"),
    "rig.verbs.run.result": ("Run", "run"),
    "rig.procedures.errors": ("DataError",),
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
