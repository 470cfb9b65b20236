"""Phasedic from Python, cell by cell (``# %%``: VS Code, Spyder and Jupytext open this as a notebook).

``python notebook.py`` runs all of it in a folder of its own.
"""

# %% A test to look at: pictures of a simulated pattern, pulled in six steps, and the force of each.
from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np

from hw_mocks.deformation import Affine
from hw_mocks.speckle import Speckle

folder = Path(tempfile.mkdtemp(prefix="phasedic-"))
(folder / "shots").mkdir()
speckle, strains = Speckle((256, 320), radius=2.0, seed=1), np.linspace(0, 0.01, 6)
rng = np.random.default_rng(0)
for number, strain in enumerate(strains):
    pulled = Affine(dv_dy=strain, du_dx=-0.3 * strain, x0=160, y0=128)
    image = 200 * speckle.render(pulled, (256, 320)) + 20 + rng.normal(0, 1.0, (256, 320))
    cv2.imwrite(str(folder / "shots" / f"shot_{number}.png"), np.rint(image).astype(np.uint8))
lines = [f"shot_{number}.png,{1.4 * 1e6 * strain / 1e3:.3f}" for number, strain in enumerate(strains)]
(folder / "forces.csv").write_text("file,force_kN\n" + "\n".join(lines) + "\n")

# %% One picture against another: arrays in, arrays out.
from phasedic import KernelSettings, PhaseKernel, Roi, ZoiGrid  # noqa: E402

reference, deformed = (
    cv2.imread(str(folder / "shots" / f"shot_{k}.png"), cv2.IMREAD_GRAYSCALE) for k in (0, 3)
)
grid = ZoiGrid.cover(Roi(16, 16, 288, 224), size=64, step=16)
kernel = PhaseKernel(reference, grid, KernelSettings(), noise=1.0)  # of the reference, GL
field = kernel.measure(deformed, noise=1.0)  # of this picture; without, it is estimated
print(field)
print(f"mean eyy {field.mean('eyy')[0] * 1e6:.0f} +- {field.mean('eyy')[1] * 1e6:.1f} um/m")

# %% The whole folder, as the command line does it: phasedic replay shots --load forces.csv --section 10,2
from phasedic import open_run, replay  # noqa: E402

settings = {
    "specimen.width_mm": 10,
    "specimen.thickness_mm": 2,
    "measure.roi": (16, 16, 288, 224),
    "view.enabled": False,
    "view.rrd": False,
    "output.dir": str(folder / "run"),
}
assert replay(folder / "shots", settings, forces=folder / "forces.csv").exit_code == 0

# %% The results: columns, maps, uncertainties.
run = open_run(folder / "run")
print(run.strain)
assert run.stress is not None
slope = np.polyfit(run.axial_strain, run.stress, 1)[0]
print(f"E = {slope / 1e9:.1f} GPa from {run.strain.n} instants")
eyy, sigma = run.strain.maps("eyy", -1), run.strain.maps("sigma_eyy", -1)
print(
    f"last map of eyy: {eyy.shape}, scatter {np.nanstd(eyy) * 1e6:.0f}, predicted {np.nanmedian(sigma) * 1e6:.0f} um/m"
)

# %% The same with names on the axes, where xarray is installed: pip install 'phasedic[xarray]'
try:
    import xarray  # noqa: F401
except ImportError:
    print("xarray is not installed")
else:
    from phasedic import Strain

    with Strain.open(folder / "run" / "strain.h5") as results:
        data = results.to_xarray("eyy", "sigma_eyy")
    print(data["eyy"].mean(("y", "x")).values)

# %% A page to show to others.
from phasedic import ReportRequest, TerminalScreen, make_report, save_page  # noqa: E402

save_page(
    make_report(run, ReportRequest(fields=("eyy",)), TerminalScreen(quiet=True)), folder / "report.html"
)
run.close()
print(f"report: {folder / 'report.html'}")
