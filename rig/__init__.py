"""The controller: benches, the sequencer, the run file, recovery, the closed loop, the command line."""


def __getattr__(name: str) -> str:
    """`__version__`, looked up when it is asked for: nothing is loaded before `rig.__main__` heeds interrupts."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version  # noqa: PLC0415

    try:
        return version("calibration-rig")
    except PackageNotFoundError:  # a source tree that was never installed
        return "0+source"
