"""Whether everything on the page can be seen and read: nothing outside, nothing cut off, contrast of all texts."""

from __future__ import annotations

from tests.live.ui.web.browser import Page

SIZES = ((1280, 800), (1024, 768), (390, 800))
CONTRAST = 4.5
"""WCAG 2.2, 1.4.3, of every text, large ones included."""

DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
OUTSIDE = """() => [...document.querySelectorAll("header, .stage, .stage > *, footer > *")].filter(e => {
    const b = e.getBoundingClientRect(), scrolls = e.closest("#after") && innerWidth < 700;
    return b.width && !scrolls && (b.left < -1 || b.top < -1 || b.right > innerWidth + 1
        || b.bottom > innerHeight + 1); }).map(e => `${e.tagName} ${e.id} ${e.className}`)"""
TEXTS = "button, dd, dt, th, td, .numbers output, #word, #rec, #stages li"
PANELS = ".tools, .tabs, [role=tabpanel], .results, .numbers, .legend, .strip, footer"
CUT = f"""() => [...document.querySelectorAll("{TEXTS}, {PANELS}")].filter(e => e.getBoundingClientRect().width
    && e.scrollWidth > e.clientWidth + (e.matches("{PANELS}") ? 0 : 2))
    .map(e => `${{e.tagName}} ${{e.id}} ${{e.className}} ${{e.textContent.slice(0, 40)}}`)"""
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
# Letters of a gauge's name on their white rim, and lines of a curve on its panel (WCAG 1.4.11: 3).
COLOURS = """async () => { const { colourOf, inkOf } = await import("/static/numbers.js");
    const canvas = new OffscreenCanvas(1, 1);
    const seen = colour => { const c = canvas.getContext("2d"); c.fillStyle = colour; c.fillRect(0, 0, 1, 1);
        return [...c.getImageData(0, 0, 1, 1).data].slice(0, 3); };
    return [...Array(12).keys()].map(k => [seen(colourOf(k)), seen(inkOf(k))]); }"""


def fits(page: Page, stage: str) -> None:
    """At three sizes nothing lies outside the window, and no text is cut off."""
    for width, height in SIZES:
        page.page.set_viewport_size({"width": width, "height": height})
        page.page.evaluate(DRAWN)
        outside, cut = page.page.evaluate(OUTSIDE), page.page.evaluate(CUT)
        assert not outside and not cut, f"{stage} at {width}: outside {outside}, cut {cut}"
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
