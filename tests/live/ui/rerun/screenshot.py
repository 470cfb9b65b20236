"""Headless pictures of the viewer: what a person would see of an .rrd file or of a running view.

A tool, not a test: ``python -m tests.live.ui.rerun.screenshot view.rrd shot.png [--size 1600x900] [--shrink]``; a
running view is given by its address (rerun+http://...). Needs a graphics stack, on Debian the
packages mesa-vulkan-drivers libvulkan1 libgl1-mesa-dri libxkbcommon-x11-0 libwayland-client0
fonts-dejavu-core.
"""

from __future__ import annotations

import argparse
import contextlib
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from live.ui.rerun.view import viewer_binary


class ViewerGone(RuntimeError):
    """The viewer could not start here (most often: no graphics stack)."""


@contextlib.contextmanager
def headless_viewer(size: str = "1600x900") -> Iterator[Any]:
    """A viewer without a window, as a ``rerun.experimental.ViewerClient``; raises ``ViewerGone``."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [str(viewer_binary()), "--headless", "--port", str(port), "--window-size", size]
    with subprocess.Popen([*command, "--hide-welcome-screen"], stderr=subprocess.DEVNULL) as process:
        try:
            yield _connected(process, f"rerun+http://127.0.0.1:{port}/proxy")
        except ConnectionError as error:
            # It may answer for a moment and end only when it cannot find a graphics device.
            raise ViewerGone(_why_gone(process)) from error
        finally:
            process.terminate()


def _connected(process: subprocess.Popen[bytes], address: str, timeout_s: float = 30.0) -> Any:
    from rerun.experimental import ViewerClient

    end = time.monotonic() + timeout_s
    while process.poll() is None and time.monotonic() < end:
        try:
            client = ViewerClient.connect(address)
            client.get_state()
            return client
        except Exception:
            time.sleep(0.3)
    raise ViewerGone(_why_gone(process))


def _why_gone(process: subprocess.Popen[bytes]) -> str:
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(5.0)
    return f"no headless viewer here (ended with {process.poll()}); see the packages in {__file__}"


def screenshot(
    source: str, to: Path, *, size: str = "1600x900", settle_s: float = 8.0, t: float | None = None
) -> Any:
    """Save what the viewer shows of ``source``; returns the viewer's state (views and their errors)."""
    with headless_viewer(size) as client:
        client.open(source)
        time.sleep(settle_s)
        if t is not None:
            client.set_time("time", duration=t, play_state="paused")
            time.sleep(1.0)
        client.save_screenshot(str(to.resolve()))
        return client.get_state()


def shrink(path: Path) -> None:
    """Make a screenshot small enough for a repository: a palette of 256 colours.

    The few vivid colours of the curves on the right get a share of their own; the speckle on
    the left would take it all.
    """
    from PIL import Image

    picture = Image.open(path).convert("RGB")
    middle = int(0.62 * picture.width)
    right, left = (
        picture.crop((middle, 0, *picture.size)).quantize(96, Image.Quantize.MAXCOVERAGE, dither=0),
        picture.crop((0, 0, middle, picture.height)).quantize(160, Image.Quantize.MEDIANCUT, dither=0),
    )
    palette = Image.new("P", (1, 1))
    palette.putpalette([*right.getpalette()[: 3 * 96], *left.getpalette()[: 3 * 160]])
    picture.quantize(palette=palette, dither=0).save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source")
    parser.add_argument("to", type=Path)
    parser.add_argument("--size", default="1600x900")
    parser.add_argument("--settle", type=float, default=8.0, help="s")
    parser.add_argument("--time", type=float, help="s since the start; the end without")
    parser.add_argument("--shrink", action="store_true", help="256 colours, for a repository")
    a = parser.parse_args()
    source = a.source if "://" in a.source else str(Path(a.source).resolve())
    print(screenshot(source, a.to, size=a.size, settle_s=a.settle, t=a.time), file=sys.stderr)
    if a.shrink:
        shrink(a.to)


if __name__ == "__main__":
    main()
