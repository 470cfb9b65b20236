"""``phasedic examples``: copy the examples, and render the pictures that they measure.

``shots`` has a tensile test of aluminium with its forces; ``strip`` has what a phone sees of a strip of rubber with
dots and a ruler: colour JPEG, a shift by hand, and three mistakes. ``strip.avi`` is a film of the pull.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquire.cv2_loader import load_cv2
from acquire.text import Message
from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle
from live.commands.docs import shipped
from live.config.new_files import new_folder
from live.ui.terminal.screen import print_line

E_PA, NU, PROOF_PA, HARDENING = 70e9, 0.33, 250e6, 12
AREA_M2 = 20e-3 * 2e-3
STRESSES_PA = 1e6 * np.r_[np.arange(0.0, 70.0, 5.0), 80, 100, 150, 200, 250, 285]
"""Of the 20 pictures of ``shots``; the first is the reference."""
RUBBER_NU, STRIP_STRAINS = 0.48, np.r_[np.zeros(4), np.arange(1, 9) * 0.01]
"""Strain of the twelve pictures of ``strip``; four are of the strip at rest, the fourth shifted by hand."""
SHIFT_PX, NEARER, FILM_FRAMES = (3.4, -2.7), 1.0008, 40
BACKGROUND, RULER_PX, NOISE_GL = 0.2, 50, 1.5
"""Grey level beside the strip, part of full scale; px of 5 mm on the ruler; noise of all pictures."""

FOLDER = "phasedic-examples"
CELL = "# %%"


class Strip:
    """A vertical strip with a pattern on a plain background.

    Parameters
    ----------
    shape : (H, W), px
    half_width : float, px
    radius : float, px
        Of the speckles.
    seed : int
        Of pattern and noise.
    """

    def __init__(self, shape: tuple[int, int], half_width: float, radius: float, seed: int) -> None:
        self._shape, self._half = shape, half_width
        self._speckle = Speckle(shape, radius=radius, seed=seed)
        self._noise = np.random.default_rng(seed)

    def picture(
        self, axial: float, nu: float, shift: tuple[float, float] = (0.0, 0.0), blur: float = 0.0
    ) -> NDArray[np.uint8]:
        """A picture under an engineering strain along y, (H, W), GL of 8 bits with noise."""
        rows, columns = self._shape
        x0, y0 = columns / 2, rows / 2
        pulled = Affine(*shift, du_dx=-nu * axial, dv_dy=axial, x0=x0, y0=y0)
        image = self._speckle.render(pulled, self._shape)
        edge = self._half * (1 - nu * axial) - np.abs(np.arange(columns) - x0 - shift[0])
        cover = np.clip(edge + 0.5, 0, 1).astype(np.float32)
        image = BACKGROUND + (image - BACKGROUND) * cover
        # A black line each 5 mm at the left edge, from row 50 on.
        for row in range(RULER_PX, image.shape[0] - RULER_PX // 2, RULER_PX):
            image[row - 1 : row + 2, 8:28] = 0.0
        if blur:
            image = load_cv2().GaussianBlur(image, (0, 0), blur)
        noisy = 20 + 215 * image + self._noise.normal(0, NOISE_GL, self._shape)
        return np.asarray(np.clip(np.rint(noisy), 0, 255).astype(np.uint8))


def strain_at(stress_Pa: float) -> float:
    """Ramberg-Osgood: the engineering strain at a stress."""
    return float(stress_Pa / E_PA + 0.002 * (stress_Pa / PROOF_PA) ** HARDENING)


def write_pictures(folder: Path) -> None:
    """Render ``shots``, ``strip``, ``strip.avi`` and ``mistakes`` into ``folder``, which exists."""
    for name in ("shots", "strip", "mistakes/nearer", "mistakes/blurred"):
        (folder / name).mkdir(parents=True)
    bar = Strip((640, 400), 120, 2.0, 1)
    forces = ["file,force_N"]
    for k, stress in enumerate(STRESSES_PA):
        _write(folder / "shots" / f"{k:02}.png", bar.picture(strain_at(stress), NU))
        forces.append(f"{k:02}.png,{stress * AREA_M2:.1f}")
    (folder / "forces.csv").write_text("\n".join(forces) + "\n", encoding="utf-8")
    rubber = Strip((640, 480), 130, 3.0, 2)
    for k, strain in enumerate(STRIP_STRAINS, 1):
        shift = SHIFT_PX if k > 3 else (0.0, 0.0)  # from then on
        _write(folder / "strip" / f"{k:02}.jpg", _coloured(rubber.picture(strain, RUBBER_NU, shift)))
    first = (folder / "strip" / "01.jpg").read_bytes()
    for name, picture in (
        ("nearer", rubber.picture(NEARER - 1, -1.0)),
        ("blurred", rubber.picture(0.01, RUBBER_NU, blur=4.0)),
    ):
        (folder / "mistakes" / name / "01.jpg").write_bytes(first)
        _write(folder / "mistakes" / name / "02.jpg", _coloured(picture))
    _write_film(folder / "strip.avi", rubber)


def _coloured(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A colour picture under warm light, (H, W, 3) uint8, blue first."""
    return np.stack([(picture * part).astype(np.uint8) for part in (0.8, 0.95, 1.0)], axis=-1)


def _write(path: Path, picture: NDArray[np.uint8]) -> None:
    cv2 = load_cv2()
    best = [cv2.IMWRITE_JPEG_QUALITY, 95] if path.suffix == ".jpg" else []
    _, coded = cv2.imencode(path.suffix, picture, best)
    path.write_bytes(coded.tobytes())


def _write_film(path: Path, strip: Strip) -> None:
    cv2 = load_cv2()
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10.0, (480, 640))
    for k in range(FILM_FRAMES):
        film.write(_coloured(strip.picture(0.002 * max(k - 4, 0), RUBBER_NU)))
    film.release()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic examples``."""
    words = f"new folder that they are copied to (default {FOLDER})"
    parser.add_argument("folder", nargs="?", default=FOLDER, metavar="DIR", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic examples [DIR]``; nothing is overwritten."""

    folder = Path(arguments.folder)
    ignored = shutil.ignore_patterns("__*", "*.egg-info", "build")
    with new_folder(folder) as part:
        try:
            shutil.copytree(shipped("examples"), part, ignore=ignored, dirs_exist_ok=True)
        except shutil.Error as error:  # it has the errors of all files
            raise OSError(error.args[0][0][2].partition(": ")[0]) from error
        cells = (part / "notebook.py").read_text(encoding="utf-8").split(f"\n{CELL}")
        (part / "notebook.ipynb").write_text(notebook(cells), encoding="utf-8")
        print_line(Message("rendering the pictures ..."))
        write_pictures(part)
    page = folder / "README.md"
    print_line(Message("{page} has a command for each example, and what it gives. The first:", page))
    print_line(
        f"  cd {folder}\n  phasedic replay shots --load forces.csv --section 20,2 --config gauges.toml --report"
    )
    return 0


def notebook(cells: list[str]) -> str:
    """The text of an .ipynb: the head as text, each cell with its comment."""
    parts: list[dict[str, Any]] = [
        {"cell_type": "markdown", "metadata": {}, "source": cells[0].strip('" \n')}
    ]
    for cell in cells[1:]:
        made: dict[str, Any] = {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": []}
        parts.append(made | {"source": f"#{cell.rstrip()}"})
    return json.dumps({"cells": parts, "metadata": {}, "nbformat": 4, "nbformat_minor": 4}, indent=1)
