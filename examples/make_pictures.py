"""Make the pictures of the README: the overlay of the bundled clip, moving, and its report.

    python examples/make_pictures.py [FOLDER]

runs the bundled clip and writes ``overlay.webp`` and ``report.webp`` into FOLDER, by default
``docs/pictures``. The report is drawn by playwright with the ``chromium`` on the path.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import av
import cv2
import numpy as np
from playwright.sync_api import sync_playwright

from monodyn import pipeline
from monodyn.cli.demo import CLIP, MODEL

WIDTH, HEIGHT = 600, 400
"""Size of the moving picture [px]."""
EVERY = 2
"""Every which frame it shows: 15 of 30 a second, which is smooth enough at half of the size."""
QUALITY = 75
"""Of both pictures, 0 to 100: above it the wall's noise takes most of the room."""
PAGE = {"width": 1280, "height": 1000}
"""The part of the report that is shown, from its top [px]."""
SETTLED = 1500
"""Time after which film and plots are drawn [ms]."""


def moving(film: Path, to: Path) -> None:
    """Write every second frame of a film as a moving picture that repeats for ever.

    Args:
        film: The film.
        to: The picture to write (WebP).
    """
    with av.open(str(film)) as container:
        frames = [frame.to_ndarray(format="bgr24") for frame in container.decode(video=0)]
        rate = float(container.streams.video[0].average_rate or 30)
    animation = cv2.Animation()
    animation.frames = [
        cv2.resize(frame, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA) for frame in frames[::EVERY]
    ]
    animation.durations = np.full(len(animation.frames), round(1000 * EVERY / rate))
    animation.loop_count = 0
    cv2.imwriteanimation(str(to), animation, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])


def shown(page: Path, to: Path) -> None:
    """Write the top of a page as a picture.

    Args:
        page: The page (HTML).
        to: The picture to write (WebP).
    """
    program = shutil.which("chromium")
    if program is None:
        sys.exit(
            "make_pictures: expected chromium on the path, found none; install it (apt-get install chromium)."
        )
    with sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=program, args=["--no-sandbox"])
        tab = browser.new_page(viewport=PAGE)
        tab.goto(page.as_uri())
        tab.wait_for_timeout(SETTLED)
        data = np.frombuffer(tab.screenshot(), np.uint8)
        browser.close()
    cv2.imwrite(str(to), cv2.imdecode(data, cv2.IMREAD_COLOR), [cv2.IMWRITE_WEBP_QUALITY, QUALITY])


if __name__ == "__main__":
    here = Path(__file__).parents[1] / "docs" / "pictures"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else here
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as made:
        run = Path(made) / "run"
        pipeline.run(CLIP, MODEL, run)
        moving(run / "overlay.mp4", folder / "overlay.webp")
        shown(run / "report.html", folder / "report.webp")
