"""An example of each command, shown at the end of its ``--help``; a test has every one of them parsed."""

from __future__ import annotations

EXAMPLES = {
    "run": "phasedic run --camera '/dev/video0?format=Y12&fps=30' --load '/dev/ttyUSB0?protocol=ascii&unit=N' --report",
    "demo": "phasedic demo --specimen hole --seconds 20",
    "init": "phasedic init --camera '/dev/video0?format=Y12&fps=30' --section 20,2",
    "scale": "phasedic scale --camera /dev/video0 --points 100,200,900,200 --length 25",
    "page": "phasedic page --camera '/dev/video0?format=Y12&fps=30'",
    "replay": "phasedic replay 'shots/*.tif' --zoi 32 --step 8 --load forces.csv --section 20,2 --out out",
    "batch": "phasedic batch 'runs/*/session.h5' --zoi 32 --step 8 --section 20,2 --workers 4 --out asked-again",
    "study": "phasedic study runs/20261122T081747Z/session.h5 --zoi 24,32,48,64,96 --order 1,2 --roi all",
    "map": "phasedic map out/strain.h5 eyy.png --field eyy --over shots/0000.tif",
    "show": "phasedic show runs/20261122T081747Z --from 2 --to 10",
    "export": "phasedic export runs/20261122T081747Z --to vtk --fields u,v,eyy --mm --scale 0.02 --y-up",
    "report": "phasedic report runs/20261122T081747Z --field eyy --pdf",
    "characterise": "phasedic characterise --pattern reference.tif --target 100 --out characterisation",
    "inspect": "phasedic inspect runs/20261122T081747Z/session.h5 --zoi 10,12 --frame 40 --out zoi.png",
    "check": "phasedic check --camera '/dev/video0?format=Y12&fps=30' --target 50",
    "average": "phasedic average --camera /dev/video0 --frames 64 --out dark.tif",
    "load-check": "phasedic load-check --load '/dev/ttyUSB0?protocol=mt-sics' --seconds 10",
    "identify": "phasedic identify /dev/ttyUSB0",
    "load-calibrate": "phasedic load-calibrate --load '/dev/ttyUSB0?unit=g' --mass 5 --out cell.toml",
    "recover": "phasedic recover damaged.h5 --out rescued.h5",
    "warm-up": "phasedic warm-up",
    "devices": "phasedic devices",
    "completion": "phasedic completion > ~/.local/share/bash-completion/completions/phasedic",
}


def example_of(command: str) -> str:
    """As it stands in the help; nothing where there is none."""
    return f"example:\n  {EXAMPLES[command]}\n\n" if command in EXAMPLES else ""
