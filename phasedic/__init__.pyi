"""The types of the public names; ``__init__.py`` loads them when they are first used."""

from acquire.addresses import Address as Address, Options as Options
from acquire.camera import CameraListing as CameraListing, open_camera as open_camera
from acquire.opening import Closing as Closing
from acquire.errors import (
    ConfigError as ConfigError,
    DataError as DataError,
    DeviceError as DeviceError,
    PhasedicError as PhasedicError,
)
from acquire.events import (
    Event as Event,
    EventKind as EventKind,
    EventSink as EventSink,
    device_event as device_event,
)
from acquire.frame import (
    CameraInfo as CameraInfo,
    CameraSetting as CameraSetting,
    Frame as Frame,
    frozen as frozen,
)
from acquire.load_cell import open_load_cell as open_load_cell
from acquire.load_sample import LoadCellInfo as LoadCellInfo, LoadFlag as LoadFlag, LoadSample as LoadSample
from acquire.session import Session as Session
from analysis import (
    KernelSettings as KernelSettings,
    NoiseModel as NoiseModel,
    PhaseKernel as PhaseKernel,
    Roi as Roi,
    Status as Status,
    StrainField as StrainField,
    ZoiGrid as ZoiGrid,
    warm_up as warm_up,
)
from live import VERSION as VERSION
from live.cli import main as main
from live.commands.from_python import measurements as measurements, replay as replay, run as run
from live.config.loading import Config as Config, load_config as load_config
from live.pipeline.consumer import Consumer as Consumer, Policy as Policy
from live.pipeline.measurement import Measurement as Measurement
from live.results import Display as Display, Strain as Strain
from live.results.export.formats import ExportRequest as ExportRequest, export as export
from live.results.report.report import ReportRequest as ReportRequest, make_report as make_report
from live.results.report.saving import save_page as save_page
from live.results.run_folder import RunFolder as RunFolder, open_run as open_run
from live.run.control import ControlPort as ControlPort
from live.run.live_run import LiveRun as LiveRun
from live.run.outcome import Outcome as Outcome
from live.ui.terminal.screen import TerminalScreen as TerminalScreen
