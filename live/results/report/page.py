"""The HTML of a report: one file that loads nothing else. All text is escaped here.

``Html`` is markup that is already safe; every function escapes plain strings.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence

from live.results.report.svg import STYLE

# A browser may only apply the page's own styles and show the pictures inside it.
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"

_CSS = """
:root{color-scheme:light dark;--ink:#20242a;--paper:#fff;--faint:#e6e8eb;--line:#9aa0a8;--dim:#5b626c;--mark:#9a3412;
--c0:#1f5fbf;--c1:#b8480c;--c2:#2b7a3d;--c3:#7b3fa0;--c4:#8a6d00;--c5:#0f7b83}
@media (prefers-color-scheme:dark){:root{--ink:#e3e6ea;--paper:#15181c;--faint:#2b3036;--line:#7b828c;--dim:#9ba3ad;
--mark:#f0a35e;--c0:#74a7f5;--c1:#f59a62;--c2:#73c486;--c3:#c195e6;--c4:#d9bd55;--c5:#5cc5ce}}
*{box-sizing:border-box}
body{margin:0 auto;padding:1.5rem 1.2rem 4rem;max-width:72rem;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",sans-serif}
h1{font-size:1.7rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2.4rem 0 .6rem;border-bottom:1px solid var(--faint)}
h3{font-size:1rem;margin:1.2rem 0 .3rem}p{max-width:60rem;margin:.4rem 0}.dim{color:var(--dim)}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(11.5rem,1fr));gap:.6rem;margin:1rem 0}
.tile{border:1px solid var(--faint);border-radius:6px;padding:.5rem .7rem}.tile b{display:block;font-size:1.05rem}
table{border-collapse:collapse;margin:.4rem 0;font-size:.94em}th,td{text-align:left;vertical-align:top;
padding:.22rem .9rem .22rem 0;border-bottom:1px solid var(--faint);overflow-wrap:anywhere}th{font-weight:600}
th,td:first-child{overflow-wrap:normal}.wide{overflow-x:auto}.number{text-align:right;font-variant-numeric:tabular-nums}
.open{color:var(--mark)}.error{color:#c0271b}.warning{color:var(--mark)}
svg.plot,figure{max-width:100%;margin:0}figcaption{color:var(--dim);font-size:.85rem;margin:.15rem 0 .6rem}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(30rem,100%),1fr));gap:.4rem 1.2rem}
.pairs{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(30rem,100%),1fr));
gap:.6rem 1.6rem}
.pair div{display:flex;gap:.4rem}
.pair img{max-height:25rem;min-width:0;max-width:calc(50% - .2rem);height:auto;width:auto;object-fit:contain}
.bar{max-width:34rem}.code{font:.82rem ui-monospace,monospace}
.key{display:inline-block;width:.8rem;height:.8rem;margin-right:.35rem;border:1px solid var(--line)}
@media print{body{max-width:none;padding:0;font-size:11px}h2{break-after:avoid}figure,.tile,tr{break-inside:avoid}
:root{color-scheme:light;--ink:#000;--paper:#fff;--faint:#ddd;--line:#888;--dim:#444;--mark:#9a3412;
--c0:#1f5fbf;--c1:#b8480c;--c2:#2b7a3d;--c3:#7b3fa0;--c4:#8a6d00;--c5:#0f7b83}
.plots,.pairs{grid-template-columns:1fr 1fr}}
"""


class Html(str):
    """Markup that needs no escaping."""

    __slots__ = ()


def safe(words: object) -> Html:
    """Text as markup; markup stays as it is."""
    return words if isinstance(words, Html) else Html(html.escape(str(words)))


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
    return Html(f"<section>\n{element('h2', title)}\n{inside}\n</section>") if inside else Html("")


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


def tiles(pairs: Mapping[str, str]) -> Html:
    """The main figures, a tile each."""
    found = (f'<div class="tile">{safe(name)}<b>{safe(value)}</b></div>' for name, value in pairs.items())
    return Html(f'<div class="tiles">{"".join(found)}</div>')


def captioned(inside: Html, caption: str, kind: str = "") -> Html:
    """A figure with a caption."""
    return element(
        "figure", Html(f"{inside}{element('figcaption', caption)}"), **({"class_": kind} if kind else {})
    )


def page(title: str, parts: Iterable[Html]) -> str:
    """The whole file."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{html.escape(_POLICY)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{safe(title)}</title>\n<style>{STYLE}{_CSS}</style>\n</head>\n<body>\n"
        f"{joined(part for part in parts if part)}\n</body>\n</html>\n"
    )
