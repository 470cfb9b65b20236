"""A source opened for those who measure parts of it in their own way."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from acquire.events import ignore_event
from acquire.session import Session
from live.replay.material import Material, ReplayRequest, check_window
from live.replay.pictures import picture_material
from live.replay.session import session_config, session_material, session_path
from live.setup import Config, load_config, open_rig


@contextmanager
def open_material(request: ReplayRequest) -> Iterator[tuple[Material, Config]]:
    """The material of a replay and its configuration; raises as ``replay``. Forces of a file are left out."""
    check_window(request)
    path = session_path(request.source)
    if path is not None:
        with Session.open(path) as session:
            config = session_config(session, request, {"camera.address": f"session:{path}"}, path)
            yield session_material(session, request, config, path), config
        return
    config = load_config(request.config_file, {"camera.address": request.source, **request.overrides})
    config = replace(config, load=replace(config.load, address="none:"))
    rig = open_rig(config.camera.address, "none:", ignore_event, crop=config.camera.crop)
    try:
        with rig.camera as camera:
            yield picture_material(camera, request, config), config
    finally:
        rig.close()
