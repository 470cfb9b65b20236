"""phasedic in a program: ``from phasedic import PhaseKernel, run, open_run, Consumer``.

What stands here is public. A name is loaded from its package when it is first used, so that ``import phasedic`` is
quick; ``__init__.pyi`` has the types. The packages below have common names (``analysis``, ``live``): where a module of
the same name hides one of them, that is said.
"""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_MODULES = {
    "acquire.addresses": "Address Options",
    "acquire.camera": "CameraListing open_camera",
    "acquire.opening": "Closing",
    "acquire.errors": "ConfigError DataError DeviceError PhasedicError",
    "acquire.events": "Event EventKind EventSink device_event",
    "acquire.frame": "CameraInfo CameraSetting Frame frozen",
    "acquire.load_cell": "open_load_cell",
    "acquire.load_sample": "LoadCellInfo LoadFlag LoadSample",
    "acquire.session": "Session",
    "analysis": "KernelSettings NoiseModel PhaseKernel Roi Status StrainField ZoiGrid warm_up",
    "live": "VERSION",
    "live.cli": "main",
    "live.commands.from_python": "measurements replay run",
    "live.config.loading": "Config load_config",
    "live.pipeline.consumer": "Consumer Policy",
    "live.pipeline.measurement": "Measurement",
    "live.results": "Display Strain",
    "live.results.export.formats": "ExportRequest export",
    "live.results.report.report": "ReportRequest make_report",
    "live.results.report.saving": "save_page",
    "live.results.run_folder": "RunFolder open_run",
    "live.run.control": "ControlPort",
    "live.run.live_run": "LiveRun",
    "live.run.outcome": "Outcome",
    "live.ui.terminal.screen": "TerminalScreen",
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names.split()}
__all__ = [*_PLACES]


def __getattr__(name: str) -> Any:
    """The public name; raises ImportError where a module of somebody else hides one of our packages."""
    if name not in _PLACES:
        raise AttributeError(f"module 'phasedic' has no {name!r}; it has {', '.join(sorted(_PLACES))}")
    here = Path(__file__).resolve().parents[1]
    for package in ("acquire", "analysis", "hw_mocks", "live"):
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            raise ImportError(f"{here / package} is missing; install phasedic again")
        if Path(spec.origin).resolve().parents[1] != here:
            raise ImportError(
                f"{spec.origin} hides phasedic's package {package}: rename it, or move the script"
            )
    value = globals()[name] = getattr(import_module(_PLACES[name]), name)
    return value


def __dir__() -> list[str]:
    return [*globals(), *_PLACES]
