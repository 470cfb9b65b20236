"""The wheel has the pages and the examples too, in the package ``phasedic``; all else is in pyproject.toml."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

KINDS = {"docs": "*.md", "examples": "*"}


class BuildWithPages(build_py):
    """Copies the files where ``phasedic docs`` and ``phasedic examples`` find them."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        for folder, kind in KINDS.items():
            there = Path(self.build_lib, "phasedic", folder)
            shutil.rmtree(there, ignore_errors=True)
            for path in sorted(Path(folder).rglob(kind)):
                if path.is_file() and not path.name.startswith("__") and "__pycache__" not in path.parts:
                    (there / path.relative_to(folder)).parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(path, there / path.relative_to(folder))


setup(cmdclass={"build_py": BuildWithPages})
