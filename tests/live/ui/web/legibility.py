"""Whether everything on the page can be seen and read: nothing outside, nothing cut off, contrast of all texts."""

from __future__ import annotations

from pathlib import Path

from tests.live.ui.web.browser import Page

SIZES = ((1920, 1080), (1280, 800), (1024, 768), (768, 1024), (390, 844), (640, 400))
LOCALES = ("en-US", "de-DE", "fr-FR")
CONTRAST = 4.5
"""WCAG 2.2, 1.4.3, of every text, large ones included."""

DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
CHECK = (Path(__file__).parent / "legibility.js").read_text("utf-8")
"""Sideways scrolling, texts that are cut, overlap or leave their box, targets under 44 px, contrast; notes too."""
# Colours are composed over what lies below, with the opacity of all parents; what is disabled needs no contrast.
FAINT = """least => {
    const numbers = text => {
        const m = text.match(/-?[\\d.]+(e-?\\d+)?/g).map(Number); return [m[0], m[1], m[2], m[3] ?? 1]; };
    const over = (a, b) => [0, 1, 2].map(k => a[k] * a[3] + b[k] * (1 - a[3])).concat(1);
    const light = c => c.slice(0, 3).map(v => v / 255)
        .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
        .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0.05);
    const ratio = (a, b) => Math.max(light(a), light(b)) / Math.min(light(a), light(b));
    const ground = e => { if (!e) return [255, 255, 255, 1]; const c = numbers(getComputedStyle(e).backgroundColor);
        return c[3] >= 1 ? c : over(c, ground(e.parentElement)); };
    const opacity = e => e ? Number(getComputedStyle(e).opacity) * opacity(e.parentElement) : 1;
    const found = [], look = (e, text, style) => { const below = ground(e), c = numbers(style.color);
        c[3] *= opacity(e);
        const r = ratio(over(c, below), below);
        if (r < least) found.push(`${r.toFixed(2)} ${e.tagName} ${e.id} ${e.className} ${text.slice(0, 40)}`); };
    let seen = 0;
    for (const e of document.querySelectorAll("body *")) {
        const own = [...e.childNodes].filter(n => n.nodeType === 3).map(n => n.data.trim()).join("");
        const text = own || (e.value ?? "");
        const hidden = !e.checkVisibility({ visibilityProperty: true }) || !e.getBoundingClientRect().width;
        if (hidden || e.closest(":disabled, [aria-disabled=true], option, svg, .pausing footer")) continue;
        if (text) { look(e, String(text), getComputedStyle(e)); seen += 1; }
        if (e.placeholder) look(e, e.placeholder, getComputedStyle(e, "::placeholder"));
    }
    return [seen, found];
}"""
# Letters of a gauge's name on their white rim; the panel and the lines of curves on it (WCAG 1.4.11: 3).
SEEN = """const canvas = new OffscreenCanvas(1, 1);
    const seen = colour => { const c = canvas.getContext("2d"); c.fillStyle = colour; c.fillRect(0, 0, 1, 1);
        return [...c.getImageData(0, 0, 1, 1).data].slice(0, 3); };"""
LETTERS = f"""async () => {{ const {{ inkOf }} = await import("/static/numbers.js"); {SEEN}
    return [...Array(12).keys()].map(k => seen(inkOf(k))); }}"""
LINES = f"""() => {{ {SEEN} const style = getComputedStyle(document.documentElement);
    return ["panel", "c1", "c2", "c3", "c4", "c5", "c6"].map(name =>
        seen(style.getPropertyValue(`--${{name}}`).trim())); }}"""


def fits(page: Page, stage: str) -> None:
    """At six sizes nothing is cut, overlaps or leaves its box, and all that is pressed is large enough."""
    for width, height in SIZES:
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.evaluate(DRAWN)
        found = page.page.evaluate(f"({CHECK})({{ ellipsis: true }})")
        faults = [one for one in found if not one.startswith("note")]
        assert not faults, f"{stage} at {width} x {height}: {faults}"
    page.page.set_viewport_size({"width": 1280, "height": 800})


def readable(page: Page, stage: str) -> None:
    """All texts have their contrast, in light and in dark."""
    for _ in range(2):
        seen, faint = page.page.evaluate(FAINT, CONTRAST)
        theme = page.page.get_attribute("html", "data-theme")
        assert seen > 10 and not faint, f"{stage}, {theme}: {faint}"
        page.page.evaluate("() => document.getElementById('theme').click()")


def luminance(colour: list[int]) -> float:
    """Relative luminance of an sRGB colour (WCAG 2.2)."""
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in (c / 255 for c in colour)]
    return sum(v * share for v, share in zip(linear, (0.2126, 0.7152, 0.0722), strict=True))


def contrast(a: list[int], b: list[int]) -> float:
    """Of two sRGB colours, from 1 to 21."""
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)
