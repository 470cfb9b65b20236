"""The example devices as if they were installed: their entry points, without pip."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "own-devices"


def install_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the example and the metadata that ``pip install`` would write on the path."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    info = tmp_path / "site" / "phasedic_own_devices-0.1.0.dist-info"
    info.mkdir(parents=True)
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {target}" for name, target in entries.items())]
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: phasedic-own-devices\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(info.parent))
    monkeypatch.syspath_prepend(str(EXAMPLE))
