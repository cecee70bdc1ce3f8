"""All pages in a browser: plots at every width, in both colour schemes and on paper; no column is lost."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import monodyn
from browser import AXES, HIDDEN, INK, WIDTHS, chromium, fills_its_cards, opened, resized
from experiments import moved, repetition
from fits import identified, noisy_film, record
from lives import double, followed
from monodyn.live.meter import Meter
from monodyn.live.view import View
from monodyn.reproduce.claims import claims
from monodyn.reproduce.experiment import figures
from monodyn.reproduce.page import PageContent, page_text
from monodyn.results.findings import Findings
from monodyn.results.page import page_text as report_text
from monodyn.results.predict import predict
from monodyn.results.predicted import Wanted, predict_run
from monodyn.results.trace import trace_of

pytestmark = pytest.mark.slow
PAGES = ("report.html", "prediction.html", "reproduce.html")


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One page of each kind that has plots; that of a controller is made as that of a prediction."""
    folder = tmp_path_factory.mktemp("pages")
    fit = identified()
    poses = record(fit)
    run = monodyn.report(fit, predict(fit, until=float(poses.time[-1]) + 1.0), to=folder / "run", poses=poses)
    predict_run(folder / "run", folder / "ahead", Wanted(until=1.0))
    cases = [moved("I", 1e-3), moved("II", 1e-3, series="with-friction"), moved("III", 0.0)]
    cases += [moved("I", 1e-3, frames=n) for n in (20, 30)]
    found = [repetition(*cases), repetition(*cases)]
    content = PageContent("About.", found, claims([one.evidence for one in found]), figures(found), [])
    (folder / "reproduce.html").write_text(page_text(content), encoding="utf-8")
    return dict(
        zip(PAGES, (run, folder / "ahead" / "prediction.html", folder / "reproduce.html"), strict=True)
    )


@pytest.mark.parametrize("name", PAGES)
def test_plots_fill_their_cards_at_every_width_and_no_column_is_lost(browser, pages, name):
    page = opened(browser, pages[name])
    for width in (*WIDTHS, *reversed(WIDTHS)):
        resized(page, width)
        assert fills_its_cards(page), width
        assert page.evaluate("document.documentElement.scrollWidth") == width
        assert page.evaluate(HIDDEN) == 0, width
    assert page.wrong == []


def test_a_report_plays_its_film_at_every_width(browser, tmp_path):
    fit = identified()
    text = report_text(
        Findings(fit, [trace_of(fit, record(fit))], "x"), (noisy_film(tmp_path / "film.mp4"), b"")
    )
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    page = opened(browser, tmp_path / "report.html")
    for width in (1280, 390):
        resized(page, width)
        page.wait_for_function("document.querySelector('video').currentTime > 0.1")
        # the film comes first, and fits in
        box = page.evaluate("document.querySelector('video').getBoundingClientRect().toJSON()")
        assert 0.0 < box["x"] < box["right"] < width
        assert box["y"] < 300.0
        assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.wrong == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_that_is_written_once_more_into_its_window_has_its_plots(browser, pages, name):
    """Names of its script that were seen everywhere stood in their own way: all plots were lost."""
    page = opened(browser, "about:blank")
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.set_content(pages[name].read_text(encoding="utf-8"))
        assert fills_its_cards(page), width
    assert page.wrong == []


@pytest.mark.parametrize("name", PAGES)
def test_plots_have_the_colours_of_the_page_and_light_ones_on_paper(browser, pages, name):
    page, light, dark = opened(browser, pages[name]), "rgb(29, 33, 38)", "rgb(231, 233, 235)"
    assert page.evaluate(INK) == [light]
    page.emulate_media(color_scheme="dark")
    resized(page, WIDTHS[1])
    assert page.evaluate(INK) == [dark]
    # what the browser does around printing, held in between
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print", color_scheme="dark")
    resized(page, 703)
    assert page.evaluate(INK) == [light]
    assert fills_its_cards(page)
    # A4 within the margins of the page
    assert page.evaluate("document.documentElement.scrollWidth") == 703
    assert page.evaluate(HIDDEN) == 0
    page.emulate_media(media="screen", color_scheme="dark")
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    resized(page, WIDTHS[0])
    assert page.evaluate(INK) == [dark]
    assert fills_its_cards(page)
    assert page.pdf(format="A4").startswith(b"%PDF")
    assert fills_its_cards(page)
    assert page.wrong == []


@pytest.mark.parametrize("name", PAGES)
def test_every_axis_says_what_it_shows(browser, pages, name):
    titles = opened(browser, pages[name]).evaluate(AXES)
    assert titles
    counted = ("fitted frames", "periods in the fitted frames", "silhouettes drawn")
    wrong = [title for title in titles if title not in counted and not _quantity_and_unit(title)]
    assert wrong == []


def _quantity_and_unit(title: str) -> bool:
    quantity, _, unit = title.partition(" [")
    return bool(quantity.strip()) and unit.endswith("]") and len(unit) > 1


def test_the_view_of_a_stream_loses_nothing_at_any_width(browser):
    from wsgiref.simple_server import WSGIRequestHandler, make_server

    view = View("camera 0", 0.5, Meter())
    view.add(followed(fit=double()))
    quiet = type("Quiet", (WSGIRequestHandler,), {"log_message": lambda *_: None})
    with make_server("127.0.0.1", 0, view, handler_class=quiet) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        # the film would keep the one thread of this server
        context = browser.new_context(viewport={"width": WIDTHS[0], "height": 900})
        context.route("**/film*", lambda route: route.abort())
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        page.wait_for_selector("#parameters:not([hidden])")
        for width in (*WIDTHS, *reversed(WIDTHS)):
            resized(page, width)
            assert page.evaluate("document.documentElement.scrollWidth") == width
            assert page.evaluate(HIDDEN) == 0, width
        context.close()
        server.shutdown()
    view.close()
