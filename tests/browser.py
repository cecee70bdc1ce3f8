"""Headless Chromium for tests of pages, and what they ask of a page; without it they are skipped, visibly."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

WIDTHS = (1400, 1100, 900, 420)
"""Widths of a window in which pages are looked at [px]."""
QUIET = (
    "no-first-run",
    "disable-gpu",
    "disable-sync",
    "disable-background-networking",
    "disable-component-update",
)
"""Switches of a browser that does nothing but show a page."""
SIZES = """() => [...document.querySelectorAll(".plot")].map((card) => {
  const drawn = card.querySelector(".main-svg")?.getBoundingClientRect();
  return [card.clientWidth, card.clientHeight, drawn?.width ?? 0, drawn?.height ?? 0];
})"""
AXES = """() => [...document.querySelectorAll(".plot")].flatMap((card) => {
  const axes = Object.entries(card._fullLayout).filter(([name]) => /^[xy]axis\\d*$/.test(name));
  return axes.map(([, axis]) => axis.title.text);
})"""
INK = """() => [...new Set([...document.querySelectorAll(".plot .xtick text")]
  .map((text) => getComputedStyle(text).fill))]"""
HIDDEN = """() => [...document.querySelectorAll(".scroll, #joints, #parameters")].filter((place) => {
  const box = place.classList.contains("scroll") ? place : place.parentElement;
  const said = getComputedStyle(place, "::before").content.includes("scroll");
  return box.offsetWidth && box.scrollWidth > box.clientWidth + 1 && !said;
}).length"""


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield Debian's Chromium, headless."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("there is no chromium on this machine")
    # the superuser has no sandbox
    more = ["no-sandbox"] if os.geteuid() == 0 else []
    with playwright.sync_playwright() as tool:
        browser = tool.chromium.launch(
            executable_path=program, args=[f"--{name}" for name in (*QUIET, *more)]
        )
        yield browser
        browser.close()


def opened(browser: Any, address: Path | str, width: int = WIDTHS[0], scheme: str = "light") -> Any:
    """Return a page, shown in a window of its own; whatever goes wrong in it is in ``page.wrong``."""
    page = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme).new_page()
    page.wrong = []
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("console", lambda said: page.wrong.append(said.text) if said.type == "error" else None)
    page.goto(address.as_uri() if isinstance(address, Path) else address)
    return page


def resized(page: Any, width: int) -> None:
    """Give the window another width and wait until the page has followed it."""
    page.set_viewport_size({"width": width, "height": 900})
    # observers of sizes are called in a frame; what they draw is laid out in the next one
    page.evaluate("() => new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(() => go())))")


def fills_its_cards(page: Any) -> bool:
    """Return True where each plot of a page, of one at least, is drawn as large as its card."""
    sizes = page.evaluate(SIZES)
    return bool(sizes) and all(
        width > 300 and height > 200 and abs(width - drawn) < 1.5 and abs(height - tall) < 1.5
        for width, height, drawn, tall in sizes
    )
