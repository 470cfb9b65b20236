"""``phasedic report``: report one or several finished runs as an HTML page."""

from __future__ import annotations

import argparse
import os
from contextlib import ExitStack
from pathlib import Path

from acquire.errors import ConfigError, PhasedicError
from acquire.text import Message, about
from live.commands.options import add_gauge_option, add_gauges, number
from live.config.new_files import check_free, free_name, new_file
from live.pipeline.consumer import Screen
from live.results.finished.figures_file import FILE, FiguresFile
from live.results.quantities import Display
from live.results.report.report import Report, ReportRequest, make_report
from live.results.report.saving import NO_BROWSER, find_browser, save_figures, save_page, save_pdf
from live.results.report.several import compare, report_of_cameras, tests_of, write_table
from live.results.run_folder import RunFolder, open_run
from live.results.sides import cameras_in
from live.ui.terminal.screen import TerminalScreen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``phasedic report``."""
    parser.add_argument("run", nargs="?", help="folder of a run or replay, or a strain.h5")
    words = "new page (default: report.html in the folder; report-2.html where that is there)"
    parser.add_argument("--out", metavar="FILE.html", help=words)
    parser.add_argument("--pdf", action="store_true", help="also print the page to a PDF; needs a browser")
    parser.add_argument(
        "--figures", metavar="DIR", help="also write the figures as SVG, PNG and CSV to a new folder"
    )
    words = "instant of the maps, s; may be repeated (default: first, elastic, yield, highest, last)"
    parser.add_argument(
        "--at", dest="times", action="append", type=number(), default=[], metavar="S", help=words
    )
    words = "map to show; may be repeated (default: the strain along the load)"
    parser.add_argument("--field", dest="fields", action="append", default=[], metavar="NAME", help=words)
    parser.add_argument(
        "--scale", type=number(), metavar="MM/PX", help="size of one pixel, mm (default: as configured)"
    )
    words = "compare several tests in one page: curves, mean and scatter, and a CSV beside it"
    add_gauge_option(parser)
    parser.add_argument("--compare", nargs="+", default=[], metavar="RUN", help=words)


def command(arguments: argparse.Namespace) -> int:
    """``phasedic report``."""
    runs = [*([arguments.run] if arguments.run else []), *arguments.compare]
    if not runs:
        raise ConfigError("give the folder of a run, or several after --compare")
    screen = TerminalScreen()
    if arguments.pdf and find_browser() is None:
        raise ConfigError(about("--pdf", NO_BROWSER))
    if arguments.run and not arguments.compare and cameras_in(Path(arguments.run)):
        return _of_cameras(Path(arguments.run), arguments, screen)
    with ExitStack() as opened:
        found = [opened.enter_context(open_run(run)) for run in runs]
        for run in found if arguments.more_gauges else ():
            add_gauges(run, Path(arguments.more_gauges))
        default = Path("comparison.html") if arguments.compare else found[0].path / "report.html"
        out = Path(arguments.out) if arguments.out else _first_free(default, arguments)
        check_free(*_targets(out, arguments))
        if arguments.compare:
            tests = tests_of(found)
            report = compare(tests)
            with new_file(out.with_suffix(".csv")) as part, part.open("x", encoding="utf-8") as file:
                write_table(tests, file)
            screen.print(str(out.with_suffix(".csv")))
        else:
            report = _reported(found[0], _request(arguments, found[0]), screen)
        for note in (note for run in found for note in run.notes):
            screen.print(Message("note: {what}", note))
    _save(report, out, arguments, screen)
    return 0


def _of_cameras(folder: Path, arguments: argparse.Namespace, screen: Screen) -> int:
    """Report a test with several cameras, and each camera where it has no report yet."""
    if arguments.pdf or arguments.more_gauges or arguments.times or arguments.fields:
        raise ConfigError(
            "{folder} has several cameras; --pdf, --gauges, --at and --field are for one, such as {one}",
            folder,
            folder / cameras_in(folder)[0],
        )
    out = Path(arguments.out) if arguments.out else _first_free(folder / "report.html", arguments)
    check_free(*_targets(out, arguments))
    _save(_report_of_cameras(folder, out, screen), out, arguments, screen)
    return 0


def _report_of_cameras(folder: Path, out: Path, screen: Screen) -> Report:
    pages = {name: folder / name / "report.html" for name in cameras_in(folder)}
    for name, page in pages.items():
        if not page.exists():
            write_report(folder / name, screen)
    with ExitStack() as opened:
        runs = {name: opened.enter_context(open_run(folder / name)) for name in pages}
        names = {name: os.path.relpath(page, out.parent) for name, page in pages.items() if page.exists()}
        return report_of_cameras(runs, names)


def write_report(folder: Path, screen: Screen) -> str:
    """``report.html`` in the folder of a run; an error is printed, returned, and does not affect the run."""
    try:
        page = folder / "report.html"
        if cameras_in(folder):
            save_page(_report_of_cameras(folder, page, screen), page)
        else:
            with open_run(folder) as run:
                save_page(_reported(run, ReportRequest(mm_per_px=run.mm_per_px), screen), page)
        screen.print(f"  {page}")
    except PhasedicError as error:
        screen.print(Message("warning: no report was made: {why}", error))
        return error.text
    return ""


def _reported(run: RunFolder, wanted: ReportRequest, screen: Screen) -> Report:
    """The report of one run, which gets its ``figures.json`` where it has none: a run that was killed wrote none."""
    report = make_report(run, wanted, screen)
    if report.test is not None and not (run.path / FILE).exists():
        try:
            report.test.cycles.write(run.path)
            FiguresFile.of(report.test, run.frame_counts or {}, 0).write(run.path)
        except PhasedicError as error:
            screen.print(Message("note: {what}", error))
    return report


def _request(arguments: argparse.Namespace, run: RunFolder) -> ReportRequest:
    scale = Display(arguments.scale).mm_per_px or run.mm_per_px
    return ReportRequest(tuple(arguments.fields), tuple(arguments.times), scale)


def _targets(out: Path, arguments: argparse.Namespace) -> list[Path]:
    """All files that will be made; if one exists, none is made."""
    beside = [".csv"] * bool(arguments.compare) + [".pdf"] * arguments.pdf
    figures = [Path(arguments.figures)] if arguments.figures else []
    return [out, *(out.with_suffix(suffix) for suffix in beside), *figures]


def _first_free(page: Path, arguments: argparse.Namespace) -> Path:
    """The page, or the same with a number, so that neither it nor what is saved beside it is there."""
    beside = argparse.Namespace(**{**vars(arguments), "figures": None})

    def is_taken(stem: str) -> bool:
        return any(file.exists() for file in _targets(page.with_stem(stem), beside))

    return page.with_stem(free_name(page.stem, is_taken))


def _save(report: Report, out: Path, arguments: argparse.Namespace, screen: Screen) -> None:
    save_page(report, out)
    screen.print(str(out))
    if arguments.figures:
        save_figures(report.figures, Path(arguments.figures), screen)
        screen.print(arguments.figures)
    if arguments.pdf:
        save_pdf(out, out.with_suffix(".pdf"))
        screen.print(str(out.with_suffix(".pdf")))
