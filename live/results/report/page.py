"""The HTML of a report: one file that loads nothing else. All text is escaped here.

``Html`` is markup that is already safe; every function escapes plain strings.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence

from acquire.text.message import joined as texts
from acquire.text.quantity import PLUS_MINUS, Printed
from live.results.maps.colours import LINES, LINES_ON_DARK
from live.results.report.svg import STYLE
from live.words.language import of_terminal, told

# A browser may only apply the page's own styles and show the pictures inside it.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

_LIGHT = (
    "--ground:#e9ecef;--panel:#fff;--sunk:#f3f5f7;--ink:#12171d;--soft:#4c5660;--line:#d5dae0;--edge:#76808b;"
    "--good:#14683a;--look:#855000;--look-tint:#fcefd6;--bad:#b3261e;--bad-tint:#fce6e4;--grid:#e3e7eb"
    + "".join(f";--c{k}:{line}" for k, line in enumerate(LINES, 1))
)
_DARK = (
    "--ground:#0d1115;--panel:#171c22;--sunk:#10151a;--ink:#eef2f5;--soft:#abb5bf;--line:#2d353e;--edge:#7c8792;"
    "--good:#63cd90;--look:#f0b952;--look-tint:#38290c;--bad:#ff9289;--bad-tint:#421a17;--grid:#262d35"
    + "".join(f";--c{k}:{line}" for k, line in enumerate(LINES_ON_DARK, 1))
)
_CSS = (
    f"""
:root{{color-scheme:light dark;{_LIGHT}}}
@media (prefers-color-scheme:dark){{:root{{{_DARK}}}}}
@media print{{:root{{color-scheme:light;{_LIGHT};--ground:#fff}}}}
"""
    + """
*{box-sizing:border-box}
body{margin:0 auto;padding:1rem .5rem 3rem;max-width:76rem;background:var(--ground);color:var(--ink);
font:15px/1.4 "Liberation Sans",Arial,"Helvetica Neue","Noto Sans","DejaVu Sans",sans-serif;
font-variant-numeric:tabular-nums lining-nums}
h1{font-size:1.5rem;margin:.2rem .25rem}h2{font-size:1.125rem;margin:0 0 .5rem}h3{font-size:1rem;margin:1rem 0 .25rem}
p{max-width:62rem;margin:.4rem 0}.dim{color:var(--soft)}body>.dim{margin:.2rem .25rem .75rem}
.panel{margin:.5rem 0;padding:.75rem;background:var(--panel);border:1px solid var(--line);border-radius:6px}
.band{margin:.5rem 0;padding:.5rem .75rem;max-width:none;border:1px solid var(--line);border-left:8px solid var(--edge);
border-radius:6px;background:var(--panel);font-weight:700}
.band span{font-weight:400;color:var(--soft)}.band.good{border-left-color:var(--good);color:var(--good)}
.band.look{border-left-color:var(--look);color:var(--look)}
.band.bad{border-left-color:var(--bad);background:var(--bad-tint);color:var(--bad)}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(11rem,1fr));gap:.5rem;margin:.5rem 0}
.tile{padding:.5rem .75rem;background:var(--panel);border:1px solid var(--line);border-radius:6px}
.tile h3{margin:0;font-size:.9375rem;font-weight:600;color:var(--soft)}.tile p{margin:0}
.tile .value{display:flex;flex-wrap:wrap;gap:.3rem;align-items:baseline;color:var(--soft)}
.tile .value b{font-size:1.5rem;line-height:1.2;color:var(--ink)}.tile .sigma{font-size:.8125rem;color:var(--soft)}
.fold>summary{cursor:pointer;font-size:1.125rem;font-weight:700}.fold[open]>summary{margin-bottom:.5rem}
table{border-collapse:collapse;margin:.4rem 0;font-size:.94em}th,td{text-align:left;vertical-align:top;
padding:.22rem .9rem .22rem 0;border-bottom:1px solid var(--line);overflow-wrap:anywhere}th{font-weight:600}
th,td:first-child{overflow-wrap:normal}.wide{overflow-x:auto}.number{text-align:right}
.open,.warning{color:var(--look)}.error{color:var(--bad)}
svg.plot,figure{max-width:100%;margin:0}figcaption{color:var(--soft);font-size:.8125rem;margin:.15rem 0 .6rem}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(30rem,100%),1fr));gap:.5rem 1.2rem}
.pairs{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(30rem,100%),1fr));gap:.6rem 1.6rem}
.pair div{display:flex;gap:.4rem}
.pair img{max-height:25rem;min-width:0;max-width:calc(50% - .2rem);height:auto;width:auto;object-fit:contain}
.bar{max-width:34rem}.code{font:.82rem ui-monospace,monospace}
.key{display:inline-block;width:.8rem;height:.8rem;margin-right:.35rem;border:1px solid var(--edge)}
@media print{body{max-width:none;padding:0;font-size:11px}.panel{padding:0;border:0}h2{break-after:avoid}
figure,.tile,.band,tr{break-inside:avoid}.plots,.pairs{grid-template-columns:1fr 1fr}
*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
"""
)

Shown = str | tuple[Printed, str]
"""A text, or the parts of a quantity with a remark."""


class Html(str):
    """Markup that needs no escaping."""

    __slots__ = ()


def safe(words: object) -> Html:
    """Text as markup, messages in the language of the terminal; markup stays as it is."""
    return words if isinstance(words, Html) else Html(html.escape(told(words)))


def joined(parts: Iterable[Html], between: str = "\n") -> Html:
    """Parts one after the other."""
    return Html(html.escape(between).join(parts))


def element(name: str, inside: object, **attributes: str) -> Html:
    """``<name attributes>inside</name>``; ``class_`` gives the attribute class."""
    words = "".join(f' {key.rstrip("_")}="{html.escape(value)}"' for key, value in attributes.items())
    return Html(f"<{name}{words}>{safe(inside)}</{name}>")


def section(title: str, *parts: Html) -> Html:
    """A heading and its parts; empty where all parts are empty."""
    inside = joined(part for part in parts if part)
    return (
        Html(f'<section class="panel">\n{element("h2", title)}\n{inside}\n</section>') if inside else Html("")
    )


def fold(title: str, *parts: Html) -> Html:
    """A section that a reader can close; empty where all parts are empty."""
    inside = joined(part for part in parts if part)
    words = f'<details class="panel fold" open><summary>{safe(title)}</summary>\n{inside}\n</details>'
    return Html(words) if inside else Html("")


def band(words: object, kind: str, more: str = "") -> Html:
    """A message over the whole width, ``good``, ``look`` or ``bad``; ``more`` in plain letters."""
    inside = joined([safe(words), *[element("span", more)] * bool(more)], " ")
    return element("p", inside, class_=f"band {kind}")


def paragraph(words: object, kind: str = "") -> Html:
    """A paragraph, ``kind`` a class of the style sheet."""
    return element("p", words, class_=kind) if kind else element("p", words)


def facts(pairs: Mapping[str, object]) -> Html:
    """A table of names and values."""
    rows = (f"<tr><th>{safe(name)}</th><td>{safe(value)}</td></tr>" for name, value in pairs.items())
    return Html(f'<div class="wide"><table>{"".join(rows)}</table></div>')


def table(heads: Sequence[str], rows: Iterable[Sequence[object]], numbers: Sequence[int] = ()) -> Html:
    """A table; ``numbers`` are columns aligned to the right."""

    def cell(tag: str, k: int, words: object) -> str:
        kind = ' class="number"' if k in numbers else ""
        return f"<{tag}{kind}>{safe(words)}</{tag}>"

    head = "".join(cell("th", k, words) for k, words in enumerate(heads))
    body = "".join(f"<tr>{''.join(cell('td', k, w) for k, w in enumerate(row))}</tr>\n" for row in rows)
    return Html(f'<div class="wide"><table><tr>{head}</tr>\n{body}</table></div>')


def tiles(pairs: Mapping[str, Shown]) -> Html:
    """The main figures, a tile each: a value with its unit, below it its uncertainty and remark."""
    return Html(f'<div class="tiles">{"".join(_tile(*pair) for pair in pairs.items())}</div>')


def _tile(name: str, shown: Shown) -> str:
    (value, half, unit), remark = (Printed(shown, "", ""), "") if isinstance(shown, str) else shown
    words = texts(" ", (f"{PLUS_MINUS} {half}" if half else "", remark))
    sigma = f'<p class="sigma">{safe(words)}</p>' if words else ""
    return (
        f'<section class="tile"><h3>{safe(name)}</h3><p class="value"><b>{safe(value)}</b> {safe(unit)}</p>'
        f"{sigma}</section>"
    )


def captioned(inside: Html, caption: str, kind: str = "") -> Html:
    """A figure with a caption."""
    return element(
        "figure", Html(f"{inside}{element('figcaption', caption)}"), **({"class_": kind} if kind else {})
    )


def page(title: str, parts: Iterable[Html]) -> str:
    """The whole file."""
    return (
        f'<!DOCTYPE html>\n<html lang="{of_terminal()}">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{html.escape(_POLICY)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{safe(title)}</title>\n<style>{STYLE}{_CSS}</style>\n</head>\n<body>\n"
        f"{joined(part for part in parts if part)}\n</body>\n</html>\n"
    )
