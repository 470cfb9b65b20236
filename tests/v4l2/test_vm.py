"""The runner's own judgement: what counts as run, as failed, as not to be had."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.v4l2 import vm
from tests.v4l2.vm import Count


def test_a_report_is_counted(tmp_path: Path) -> None:
    report = tmp_path / "r.xml"
    report.write_text('<testsuites><testsuite tests="9" failures="1" errors="2" skipped="3"/></testsuites>')
    assert vm.count(report) == Count(ran=6, failed=3, skipped=3)
    assert vm.count(tmp_path / "none.xml") == Count(0, 0, 0)


@pytest.mark.parametrize(
    ("inside", "outside", "status", "partial", "code"),
    [
        (Count(50, 0, 0), Count(12, 0, 0), 0, False, 0),
        (Count(49, 0, 1), Count(12, 0, 0), 0, False, 1),
        (Count(50, 0, 0), Count(11, 0, 1), 0, False, 1),
        (Count(0, 0, 0), Count(12, 0, 0), 0, False, 1),
        (Count(50, 0, 0), Count(0, 0, 0), 0, False, 1),
        (Count(3, 0, 0), Count(0, 0, 0), 0, True, 0),
        (Count(50, 2, 0), Count(12, 0, 0), 1, False, 1),
        (Count(20, 0, 0), Count(0, 0, 0), vm.TIMED_OUT, False, vm.TIMED_OUT),
    ],
)
def test_a_test_that_does_not_run_counts_as_failed(
    inside: Count,
    outside: Count,
    status: int,
    partial: bool,
    code: int,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert vm.verdict(inside, outside, status, partial=partial) == code
    assert f"{inside.ran} tests ran in the virtual machine and {outside.ran} on" in capsys.readouterr().out


@pytest.mark.parametrize(("allowed", "code"), [("1", 0), ("", vm.NO_MACHINE), ("yes", vm.NO_MACHINE)])
def test_without_a_machine_it_says_why_and_fails_unless_that_is_allowed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], allowed: str, code: int
) -> None:
    def refuse(*words: object) -> int:
        raise vm.NoMachine("qemu-system-x86_64 is missing and there is no apt-get")

    monkeypatch.setattr(vm, "run_tests", refuse)
    monkeypatch.setenv("PHASEDIC_ALLOW_NO_VM", allowed)
    monkeypatch.setattr(sys, "argv", ["vm.py", "--tests"])
    assert vm.main() == code
    told = capsys.readouterr()
    assert "there is no apt-get" in told.err
    assert ("0 tests ran" in told.out) == (code == 0)


def test_a_command_that_fails_is_told_in_its_own_words() -> None:
    with pytest.raises(vm.NoMachine, match="cannot do that"):
        vm.run(sys.executable, "-c", "import sys; sys.exit('cannot do that')")


def test_the_first_files_are_an_archive_the_kernel_reads(tmp_path: Path) -> None:
    archive = vm.cpio(
        iter([("bin", 0o40755, b""), ("bin/tool", 0o100755, b"\x7fELF..."), ("init", 0o100755, b"#!")])
    )
    names = []
    position = 0
    while True:
        assert archive[position : position + 6] == b"070701"
        fields = [int(archive[position + 6 + 8 * k : position + 14 + 8 * k], 16) for k in range(13)]
        size, length = fields[6], fields[11]
        name = archive[position + 110 : position + 110 + length - 1].decode()
        if name == "TRAILER!!!":
            break
        begin = position + 110 + length + -(110 + length) % 4
        names.append((name, archive[begin : begin + size]))
        position = begin + size + -size % 4
    assert names == [("bin", b""), ("bin/tool", b"\x7fELF..."), ("init", b"#!")]


def test_the_guest_is_told_what_to_run_and_nothing_secret(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PHASEDIC_DATA", "/some where")
    monkeypatch.setenv("MY_TOKEN", "hidden word")
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    monkeypatch.setattr(vm, "first_files", lambda kernel: iter(()))
    kernel = vm.GuestKernel(tmp_path, "6.1")
    vm.write_job(tmp_path, kernel, ["python", "-c", "print('hello')"], [Path("/kept")])
    script = (tmp_path / "script").read_text()
    assert "export PHASEDIC_DATA='/some where'" in script
    assert "hidden word" not in script
    assert "OPENBLAS_CORETYPE" not in script, "the emulated processor is another one"
    assert (tmp_path / "writable").read_text() == "/kept\n"
    assert subprocess.run(["sh", "-n", str(tmp_path / "script")], check=False).returncode == 0
