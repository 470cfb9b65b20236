"""Open cameras and the load cell from their addresses.

Only this module opens the simulated devices of ``hw_mocks``. All ``sim:`` addresses share one specimen.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from acquire.addresses import parse_address, with_setting
from acquire.camera import CAMERAS, Camera, CroppedCamera, open_camera
from acquire.errors import ConfigError
from acquire.events import Event, EventSink, ignore_event
from acquire.load_cell import LOAD_CELLS, LoadCell, ZeroedLoadCell, open_load_cell
from acquire.record_mode import Crop
from live.config.sections import CameraConfig, LoadConfig

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
    camera, load = (
        CameraConfig(address=camera_address, crop=crop),
        LoadConfig(address=load_address, zero_N=zero_N),
    )
    return open_rigs([camera], load, [on_event])[0]


def open_rigs(
    cameras: Sequence[CameraConfig], load: LoadConfig, sinks: Sequence[EventSink]
) -> tuple[Rig, ...]:
    """Open all cameras of a test and its load cell, which each ``Rig`` has; raises as ``open_rig``.

    Parameters
    ----------
    cameras : sequence of CameraConfig
        Simulated ones look at the specimen of the first address.
    load : LoadConfig
        Its sign is 1.
    sinks : sequence of callables taking an Event
        One of each camera; all take the events of the load cell.
    """
    check_load_sign(load)
    simulated = [camera.address for camera in cameras if _simulated(camera.address)]
    if len(simulated) > 1:
        _check_one_specimen(simulated)
    specimen = _specimen(simulated[0] if simulated else "none:", load.address)

    def to_all(event: Event) -> None:
        for sink in sinks:
            sink(event)

    with ExitStack() as opened:
        found = [
            opened.enter_context(closing(_open_cropped(camera.address, sink, specimen, camera.crop)))
            for camera, sink in zip(cameras, sinks, strict=True)
        ]
        cell = _zeroed_load(load.address, sinks[0] if len(sinks) == 1 else to_all, specimen, load.zero_N)
        opened.pop_all()
    return tuple(
        Rig(camera, cell, specimen if _simulated(one.address) else None)
        for camera, one in zip(found, cameras, strict=True)
    )


def _check_one_specimen(addresses: Sequence[str]) -> None:
    """Raises ConfigError where two simulated cameras would have different specimens."""
    from hw_mocks.sim_settings import SPECIMEN_KEYS

    found = [parse_address(address) for address in addresses]
    for other in found[1:]:
        first, second = dict(found[0].settings), dict(other.settings)
        differ = sorted(key for key in SPECIMEN_KEYS if first.get(key) != second.get(key))
        if differ or found[0].target != other.target:
            what = differ[0] if differ else "kind"
            raise ConfigError(
                "{text}: not the specimen of the front; give {what} as in its address", other.text, what
            )


def check_load_port(address: str) -> None:
    """Refuse a serial port that is not there, before a camera is opened; raises DeviceError."""
    parsed = parse_address(address)
    if not parsed.scheme:
        from acquire.serial_line.ports import check_present

        check_present(parsed.target)


def check_load_sign(load: LoadConfig) -> None:
    """Refuse the sign of forces that are not live; raises ConfigError."""
    if load.sign < 0 and load.address != "none:":
        raise ConfigError(
            "load.sign is for files and recordings (replay, batch); for a load cell give sign=-1 in its address"
        )


def camera_settings() -> dict[str, type]:
    """The class of the settings of every kind of camera, by scheme."""
    from hw_mocks.scene import MemorySettings
    from hw_mocks.sim_settings import SimSettings

    return {"sim": SimSettings, "bench": MemorySettings, **dict(CAMERAS.settings())}


def load_settings() -> dict[str, type]:
    """The class of the settings of every kind of load cell, by scheme, and of every protocol that has its own."""
    from acquire.protocols.base import PROTOCOLS, find_protocol
    from hw_mocks.sim_load_cell import SimLoadSettings

    protocols = {f"protocol={name}": find_protocol(name).settings for name in PROTOCOLS}
    own = {name: kind for name, kind in protocols.items() if fields(kind)}
    return {"sim": SimLoadSettings, **dict(LOAD_CELLS.settings()), **own}


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


def _open_cropped(
    address: str, on_event: EventSink, specimen: VirtualSpecimen | None, crop: Crop | None
) -> Camera:
    camera = _open_camera(address, on_event, specimen)
    try:
        return camera if crop is None else CroppedCamera(camera, crop)
    except BaseException:
        camera.close()
        raise


def _open_camera(address: str, on_event: EventSink, specimen: VirtualSpecimen | None) -> Camera:
    if parse_address(address).scheme == "bench":
        from hw_mocks.scene import open_memory_camera

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
