"""The runner of mutants: what fits the code, and what counts as caught."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutants import __main__ as runner
from tests.mutants.__main__ import ListError, Mutant, Trial, copy_code, main, read_list, summary, try_one

CODE = "def double(value):\n    return 2 * value\n"
TEST = "from acquire.doubled import double\n\ndef test_double():\n    assert double(3) {}\n"
ENTRY = '[[mutant]]\nwhat = "{}"\nfile = "acquire/doubled.py"\nold = "{}"\nnew = "{}"\ntests = ["tests/{}"]\n'


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small tree in place of this one: a module, a test that notices and one that does not."""
    for folder in ("acquire", "tests"):
        (tmp_path / "root" / folder).mkdir(parents=True)
    made = tmp_path / "root"
    (made / "acquire" / "doubled.py").write_text(CODE)
    (made / "tests" / "test_value.py").write_text(TEST.format("== 6"))
    (made / "tests" / "test_type.py").write_text(TEST.format("is not None"))
    (made / "pyproject.toml").write_text("[tool.pytest.ini_options]\n")
    monkeypatch.setattr(runner, "ROOT", made)
    monkeypatch.setattr(runner, "LIST", tmp_path / "list.toml")
    return made


def test_the_list_fits_the_code() -> None:
    """Each mutant still stands in its file; they are tried by ``make mutants`` alone."""
    mutants = read_list(runner.LIST)
    assert len(mutants) >= 200
    assert {mutant.file.partition("/")[0] for mutant in mutants} == {
        "acquire",
        "analysis",
        "hw_mocks",
        "live",
    }


def listed(*entries: tuple[str, str, str, str]) -> None:
    runner.LIST.write_text("\n".join(ENTRY.format(*entry) for entry in entries))


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize(
    ("old", "new", "test", "says"),
    [
        ("3 * value", "1", "test_value.py", "'3 * value' stands 0 times in acquire/doubled.py, not once"),
        ("value", "1", "test_value.py", "'value' stands 2 times in acquire/doubled.py, not once"),
        ("2 * value", "2 * value", "test_value.py", "it changes nothing"),
        ("2 * value", "1", "test_gone.py", "there is no tests/test_gone.py"),
    ],
)
def test_an_entry_that_does_not_fit_the_code_fails(
    capsys: pytest.CaptureFixture[str], old: str, new: str, test: str, says: str
) -> None:
    listed(("half", old, new, test))
    with pytest.raises(ListError, match=r"mend list\.toml"):
        read_list(runner.LIST)
    assert main([]) == 2
    assert f"half: {says}" in capsys.readouterr().err


def test_caught_and_survived(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listed(
        ("noticed", "2 * value", "3 * value", "test_value.py"),
        ("not", "2 * value", "3 * value", "test_type.py"),
    )
    assert main([]) == 1
    out = capsys.readouterr().out
    assert out.splitlines()[-2:] == ["SURVIVED: not (acquire/doubled.py)", "1 of 2 mutants are caught (50%)"]
    assert main(["noticed"]) == 0
    assert main(["nothing like it"]) == 2
    assert (root / "acquire" / "doubled.py").read_text() == CODE


def test_tests_that_fail_without_any_mutant(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (root / "tests" / "test_value.py").write_text(TEST.format("== 7"))
    listed(("noticed", "2 * value", "3 * value", "test_value.py"))
    assert main([]) == 2
    assert "the tests fail without any mutant" in capsys.readouterr().err


def test_a_mutant_that_cannot_be_imported_is_not_caught(root: Path, tmp_path: Path) -> None:
    mutant = Mutant("broken", "acquire/doubled.py", "return 2 * value", "return (", ("tests/test_value.py",))
    trial = try_one(mutant, copy_code(tmp_path / "clean", root), tmp_path / "mutant")
    assert trial.verdict == "BROKEN" and "SyntaxError" in summary([trial])
    assert not (tmp_path / "mutant").exists()


def test_one_that_does_not_end_is_caught() -> None:
    assert Trial(Mutant("", "", "", "", ()), None, "", 1.0).verdict == "caught"
