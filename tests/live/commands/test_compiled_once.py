"""What is compiled ahead is all that is: nothing in a first test, and nothing by the README's next commands."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SIZE = "lockstep=yes&seconds=2&fps=10&width=320&height=256&hold=1&end=0.2"
COARSE = "--zoi 32 --step 32 --no-view --no-rrd"
SHORT = f"{COARSE} --burst 2 --reference-burst 4"
NEXT = [
    f"init rig.toml --camera sim:uniform?{SIZE}&bits=8 --load sim: --zoi 32",
    f"check --camera sim:uniform?{SIZE}&bits=8 --load sim: --zoi 32",
    f"run --config rig.toml --camera sim:uniform?{SIZE}&bits=8 {SHORT} --report --out eight",
    f"run --camera sim:uniform?{SIZE}&bits=12 --load sim: {SHORT} --out twelve",
    f"replay eight/session.h5 {COARSE} --estimator phase --out phase",
    f"replay twelve/session.h5 {COARSE} --order 2 --out order",
    "export twelve --to png",
    "map twelve map.png",
    "batch twelve/session.h5 --zoi 32 --step 32 --workers 1 --out batch",
]
AND_COMPILED = """
import os
from numba.core import event

class Compiled(event.Listener):
    def on_start(self, started):
        function = started.data["dispatcher"].py_func
        with open(os.environ["COMPILED"], "a") as file:
            file.write(f"{function.__module__}.{function.__qualname__}\\n")

    def on_end(self, ended):
        pass

event.register("numba:compile", Compiled())
"""
"""Python imports it at the start of each process, also of those that compile ahead."""
COMMANDS = """
import sys
from live.cli import main

for line in sys.argv[1:]:
    print("exit:", main(line.split()), line)
"""


def run(folder: Path, lines: list[str], **added: str) -> tuple[list[str], str]:
    """The exit codes of commands of one process; its errors and names of loops are in ``folder`` afterwards."""
    listener = folder / "listener"
    listener.mkdir()
    (listener / "sitecustomize.py").write_text(AND_COMPILED)
    added |= {"PYTHONPATH": f"{listener}{os.pathsep}{ROOT}", "COMPILED": str(folder / "compiled")}
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, *lines],
        cwd=folder, env={**os.environ, **added}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return [line.split()[1] for line in done.stdout.splitlines() if line.startswith("exit:")], done.stderr


def compiled(folder: Path) -> list[str]:
    """The loops that ``run`` compiled, but those of simulated devices, which no camera has, and numba's own parts."""
    names = folder / "compiled"
    found = names.read_text().split() if names.exists() else []
    return [name for name in found if not name.startswith(("hw_mocks.", "numba."))]


@pytest.mark.slow
def test_nothing_is_compiled_after_the_demo(tmp_path: Path) -> None:
    """Every test begins with what the demo compiles (tests/conftest.py)."""
    exits, errors = run(tmp_path, NEXT)
    assert exits == ["0"] * len(NEXT), errors
    assert compiled(tmp_path) == []


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_nothing_is_compiled_in_the_first_test(tmp_path: Path) -> None:
    """Where nothing has ever been compiled: all that the demo uses is compiled before it begins."""
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "loops")}
    ahead, test = tmp_path / "ahead", tmp_path / "test"
    for folder in (ahead, test):
        folder.mkdir()
    exits, errors = run(ahead, ["warm-up"], **cache)
    assert exits == ["0"] and len(compiled(ahead)) > 50, errors
    exits, errors = run(test, ["demo --seconds 14 --no-view --no-rrd --out out"], **cache)
    assert len(exits) == 1 and (test / "out" / "strain.h5").exists(), (
        errors
    )  # how well it measures is not asked
    assert compiled(test) == []
