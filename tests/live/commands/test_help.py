"""Every command shows an example that its own parser takes, and the shell can complete it."""

from __future__ import annotations

import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import shtab

from live.cli import main
from live.commands.arguments import COMMANDS, parse
from live.commands.completion import SHELLS, script
from live.commands.examples import EXAMPLES


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_ends_with_an_example_that_works(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert f"example:\n  {EXAMPLES[name]}\n" in said
    words = shlex.split(EXAMPLES[name].partition(" > ")[0])
    assert words[:2] == ["phasedic", name]
    assert parse(words[1:])[1].command == name


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("phasedic re", ["replay", "report", "recover"]),
        ("phasedic report --pd", ["--pdf"]),
        ("phasedic export run --to v", ["vtk"]),
        ("phasedic replay a --axis ", ["auto", "x", "y"]),
        ("phasedic replay sho", ["shots"]),
    ],
)
def test_bash_completes(tmp_path: Path, typed: str, found: list[str]) -> None:
    (tmp_path / "shots").mkdir()
    (tmp_path / "phasedic.bash").write_text(script("bash"), encoding="utf-8")
    words = [*shlex.split(typed), *([""] if typed.endswith(" ") else [])]
    asked = (
        f"source ./phasedic.bash; COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1};"
        ' _shtab_phasedic; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run(["bash", "-c", asked], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert set(done.stdout.split()) == set(found)


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_names_every_command(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    said = capsys.readouterr().out
    assert [name for name in COMMANDS if name not in said] == []


def test_the_shells_are_known_to_shtab() -> None:
    assert set(SHELLS) <= set(shtab.SUPPORTED_SHELLS)
