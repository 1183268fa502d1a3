"""Colours of pages and charts: whatever is read stands out from what is behind it, in light and in dark."""

import re

import pytest

from replay.comparison.report_html import style

CANVAS = {"light": (255.0, 255.0, 255.0), "dark": (18.0, 18.0, 18.0)}
"""What Chromium paints behind a page that names no background."""


def colours(scheme):
    """Return each custom property as (red, green, blue), laid over what the browser paints behind."""
    light, dark = (dict(re.findall(r"--(\w+): #(\w+);", line)) for line in style().splitlines()[:2])
    chosen = light if scheme == "light" else {**light, **dark}
    return {name: over(text, CANVAS[scheme]) for name, text in chosen.items()}


def over(text, behind):
    digits = text if len(text) > 4 else "".join(2 * digit for digit in text)
    red, green, blue, alpha = bytes.fromhex(digits.ljust(8, "f"))
    return tuple(a * alpha / 255 + b * (1 - alpha / 255) for a, b in zip((red, green, blue), behind, strict=True))


def contrast(a, b):
    """Return the ratio of relative luminances, as WCAG 2 defines it."""
    low, high = sorted(0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b) for r, g, b in (a, b))
    return (high + 0.05) / (low + 0.05)


def linear(channel):
    channel /= 255
    return channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("scheme", CANVAS)
def test_texts_and_curves_stand_out_from_the_page_from_text_boxes_and_from_the_band_of_a_tolerance(scheme):
    known = colours(scheme)
    box = over("8882", CANVAS[scheme])
    assert "background: #8882" in style()
    for name in ("a", "b", "bad", "good"):
        for behind in (CANVAS[scheme], box, known["band"]):
            assert contrast(known[name], behind) >= 4.5, (name, behind)
    assert contrast(known["edge"], CANVAS[scheme]) >= 3.0
    assert contrast(CANVAS[scheme], known["a"]) >= 4.5
