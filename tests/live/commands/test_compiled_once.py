"""After ``make demo`` the README's next commands compile nothing: a newcomer waits for it once."""

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


@pytest.mark.slow
def test_nothing_is_compiled_after_the_demo(tmp_path: Path) -> None:
    """Every test begins with what the demo compiles (tests/conftest.py)."""
    listener, compiled = tmp_path / "listener", tmp_path / "compiled"
    listener.mkdir()
    (listener / "sitecustomize.py").write_text(AND_COMPILED)
    added = {"PYTHONPATH": f"{listener}{os.pathsep}{ROOT}", "COMPILED": str(compiled)}
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, *NEXT],
        cwd=tmp_path, env={**os.environ, **added}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = done.stdout.splitlines()
    assert [line.split()[1] for line in lines if line.startswith("exit:")] == ["0"] * len(NEXT), done.stderr
    names = compiled.read_text().split() if compiled.exists() else []
    assert [name for name in names if not name.startswith("hw_mocks.")] == []  # no camera has its loops
