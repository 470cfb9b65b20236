"""Open camera and load cell from their addresses.

Only this module opens the simulated devices of ``hw_mocks``. Two ``sim:`` addresses share one specimen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquire.addresses import parse_address, with_setting
from acquire.camera import Camera, CroppedCamera, open_camera
from acquire.events import EventSink, ignore_event
from acquire.load_cell import LoadCell, ZeroedLoadCell, open_load_cell
from acquire.record_mode import Crop

if TYPE_CHECKING:
    from hw_mocks.specimen import VirtualSpecimen


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The devices of one test.

    Attributes
    ----------
    camera : Camera
    load : LoadCell
    specimen : VirtualSpecimen or None
        The true specimen, if the camera is simulated.
    """

    camera: Camera
    load: LoadCell
    specimen: VirtualSpecimen | None

    def close(self) -> None:
        """Close both devices."""
        self.load.close()
        self.camera.close()


def open_rig(
    camera_address: str,
    load_address: str,
    on_event: EventSink = ignore_event,
    *,
    crop: Crop | None = None,
    zero_N: float = 0.0,
) -> Rig:
    """Open both devices; raises as ``open_camera`` and ``open_load_cell``.

    Parameters
    ----------
    crop : (x, y, width, height), px, optional
        The part of the picture to use.
    zero_N : float, N
        Force from which forces count.
    """
    specimen = _specimen(camera_address, load_address)
    camera = _open_camera(camera_address, on_event, specimen)
    try:
        camera = camera if crop is None else CroppedCamera(camera, crop)
        load = _zeroed_load(load_address, on_event, specimen, zero_N)
    except BaseException:
        camera.close()
        raise
    return Rig(camera, load, specimen if _simulated(camera_address) else None)


def check_load_port(address: str) -> None:
    """Refuse a serial port that is not there, before a camera is opened; raises DeviceError."""
    parsed = parse_address(address)
    if not parsed.scheme:
        from acquire.serial_line.ports import check_present

        check_present(parsed.target)


def at_rest(address: str) -> str:
    """The address for a look at the rig before a test: a simulated test would begin by itself."""
    if not _simulated(address):
        return address
    for key, value in (("max_strain", 0.0), ("seconds", 3600.0), ("hold", 1.0), ("end", 1.0)):
        address = with_setting(address, key, value)
    return address


def _simulated(address: str) -> bool:
    return parse_address(address).scheme == "sim"


def _specimen(camera_address: str, load_address: str) -> VirtualSpecimen | None:
    if not (_simulated(camera_address) or _simulated(load_address)):
        return None
    from hw_mocks.specimen import specimen_from

    return specimen_from(parse_address(camera_address if _simulated(camera_address) else load_address))


def _open_camera(address: str, on_event: EventSink, specimen: VirtualSpecimen | None) -> Camera:
    if parse_address(address).scheme == "bench":
        from hw_mocks.memory_camera import open_memory_camera

        return open_memory_camera(parse_address(address))
    if not _simulated(address):
        return open_camera(address, on_event)
    assert specimen is not None
    from hw_mocks.sim_camera import open_sim_camera

    return open_sim_camera(parse_address(address), on_event, specimen)


def _open_load(address: str, on_event: EventSink, specimen: VirtualSpecimen | None) -> LoadCell:
    if not _simulated(address):
        return open_load_cell(address, on_event)
    assert specimen is not None
    from hw_mocks.sim_load_cell import open_sim_load

    return open_sim_load(parse_address(address), on_event, specimen)


def _zeroed_load(
    address: str, on_event: EventSink, specimen: VirtualSpecimen | None, zero_N: float
) -> LoadCell:
    if not zero_N:
        return _open_load(address, on_event, specimen)
    return ZeroedLoadCell(lambda sink: _open_load(address, sink, specimen), zero_N, on_event)


def open_load(address: str, on_event: EventSink = ignore_event, camera_address: str = "none:") -> LoadCell:
    """Open a load cell alone, also a simulated one; raises as ``open_load_cell``.

    A simulated load cell shares its specimen, which is at rest, with a simulated camera at ``camera_address``.
    """
    return _open_load(address, on_event, _specimen(at_rest(camera_address), at_rest(address)))
