"""``phasedic page``: the operator's page for set-up, run and results, test after test."""

from __future__ import annotations

import argparse
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from acquire.errors import EXIT_INTERRUPTED, DeviceError, PhasedicError
from acquire.text import Message
from acquire.text.message import brief
from live.commands.attended import page_opened
from live.commands.init import find_devices
from live.commands.options import OUTPUT, add_measure, add_options, overrides, whole
from live.commands.process import signals
from live.commands.report import write_report
from live.commands.run import OTHER_PROGRAMS, RECORDING, run_with_page
from live.config.cameras import camera_configs
from live.config.loading import load_config
from live.pipeline.consumer import Screen
from live.ui.terminal.screen import TerminalScreen
from live.ui.web.page_controller import PageController
from live.ui.web.server import DEFAULT_PORT
from live.ui.web.setup.config_draft import ConfigDraft

RIG = "rig.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic page``."""
    add_options(parser, "devices and recording", *RECORDING)
    add_options(parser, "other programs", *OTHER_PROGRAMS)
    add_measure(parser, *(name for name in OUTPUT if name != "report"))
    port_help = f"port of the page on 127.0.0.1, or the next free one (default {DEFAULT_PORT})"
    parser.add_argument(
        "--page-port", type=whole(0, 65535), default=DEFAULT_PORT, metavar="N", help=port_help
    )


def command(arguments: argparse.Namespace) -> int:
    """``phasedic page``; 0 if it is ended from the page, 130 if it is interrupted."""
    screen = TerminalScreen()
    path, given = Path(arguments.config or RIG), overrides(arguments)
    draft = ConfigDraft(load_config(path if path.exists() else None, given), path, given)
    if not draft.config.camera.address:
        choose_devices(draft, given, screen)
    interrupted = threading.Event()
    with PageController(draft, arguments.page_port) as controller:

        def interrupt() -> None:
            interrupted.set()
            controller.quit()

        with signals(interrupt, screen), page_opened(controller, screen):
            serve(controller, given, screen, interrupted)
    return EXIT_INTERRUPTED if interrupted.is_set() else 0


def choose_devices(draft: ConfigDraft, given: dict[str, Any], screen: Screen) -> None:
    """The devices that are there; without a camera the page opens all the same, with the list to choose from."""
    try:
        found = find_devices(given, screen)
    except DeviceError as error:
        screen.print(Message("{why}; or choose one on the page", brief(error)))
        return
    draft.change_all({"camera.address": found.camera, "load.address": found.load})


def serve(
    controller: PageController, given: Mapping[str, Any], screen: Screen, interrupted: threading.Event
) -> None:
    """One test after the other until the page or the program is ended; ``given`` are the options."""
    message = ""
    while not interrupted.is_set() and (config := controller.set_up(message)) is not None:
        try:
            configs = camera_configs(config, given, controller.others)
            folder, code = run_with_page(controller, configs, screen)
        except PhasedicError as error:
            message = brief(error)
            screen.print(Message("the test did not begin: {why}", message))
            continue
        message = ""
        if code == EXIT_INTERRUPTED:
            interrupted.set()
            return
        report = folder / "report.html"
        why = "" if report.exists() else write_report(folder, screen)
        controller.reported(report if report.exists() else None, why)
        if not controller.after():
            return
