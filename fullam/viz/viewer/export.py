"""Films as files: a page that plays anywhere, stills and animations through Chromium."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np

from fullam.exceptions import InvalidInput
from fullam.files import atomic_path
from fullam.simulation.progress import Progress
from fullam.viz.viewer.browser import Browser
from fullam.viz.viewer.page import film_page
from fullam.viz.viewer.replay import Film

Size = tuple[int, int]

STILL, ANIMATION = (1200, 750), (640, 400)
"""Sizes of a still and of an animation [px]."""

GIF_RATE = 12.5
"""Frames of an animation in a second; GIF counts in hundredths of a second."""

MOST_GIF_FRAMES = 400
"""An animation of a longer flight has fewer frames in a second."""


def write_html(film: Film, path: str | Path) -> Path:
    """Write one page that plays the film without any network: play, pause, slider, speed.

    Args:
        film: The film.
        path: A file that ends in .html.

    Raises:
        InvalidInput: The name ends in something else.
    """
    path = _checked(path, ".html")
    with atomic_path(path) as temporary:
        temporary.write_text(film_page(film), encoding="utf-8")
    return path


def write_png(film: Film, path: str | Path, at: float | None = None, size: Size = STILL) -> Path:
    """Write a still, taken by headless Chromium.

    Args:
        film: The film.
        path: A file that ends in .png.
        at: When [s]; half-way by default.
        size: Width and height [px].

    Raises:
        BrowserError: There is no Chromium, or it fails.
        InvalidInput: The name ends in something else, or there is no such time.
    """
    path = _checked(path, ".png")
    moment = _moment(film, at)
    with tempfile.TemporaryDirectory() as folder, _opened(film, Path(folder), size) as browser:
        browser.evaluate(f"fullam.seek({moment!r})")
        picture = _compact(browser.screenshot())
    with atomic_path(path) as temporary:
        temporary.write_bytes(picture)
    return path


def write_gif(
    film: Film,
    path: str | Path,
    size: Size = ANIMATION,
    rate: float = GIF_RATE,
    progress: Progress | None = None,
) -> Path:
    """Write an animation of the whole film that repeats, its frames taken by headless Chromium.

    Args:
        film: The film.
        path: A file that ends in .gif.
        size: Width and height [px].
        rate: Frames in a second.
        progress: Told (frames taken, frames in all).

    Raises:
        BrowserError: There is no Chromium, or it fails.
        InvalidInput: The name ends in something else.
    """
    from PIL import Image

    path = _checked(path, ".gif")
    count = int(np.clip(round(film.duration * rate), 1, MOST_GIF_FRAMES))
    times = np.linspace(0.0, film.duration, count, endpoint=count == 1)
    frames = []
    with tempfile.TemporaryDirectory() as folder, _opened(film, Path(folder), size) as browser:
        for k, moment in enumerate(times.tolist()):
            browser.evaluate(f"fullam.seek({moment!r})")
            picture = Image.open(io.BytesIO(browser.screenshot())).convert("RGB")
            frames.append(picture)
            if progress is not None:
                progress(k + 1, count)
    # One palette for all frames: what does not move does not flicker, and is stored once.
    palette = frames[len(frames) // 2].quantize(256, dither=Image.Dither.NONE)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    pause = round(1000.0 * film.duration / count) if film.duration else 1000
    with atomic_path(path) as temporary:
        frames[0].save(temporary, save_all=True, append_images=frames[1:], duration=pause, loop=0)
    return path


def _opened(film: Film, folder: Path, size: Size) -> Browser:
    """Chromium with the film, paused at its start, no network, no player."""
    browser = Browser(*size, network=False)
    try:
        page = folder / "film.html"
        page.write_text(film_page(film, play=False, mode="still"), encoding="utf-8")
        browser.open(page)
    except BaseException:
        browser.close()
        raise
    return browser


def _compact(picture: bytes) -> bytes:
    """The same PNG in fewer bytes."""
    from PIL import Image

    out = io.BytesIO()
    Image.open(io.BytesIO(picture)).convert("RGB").save(out, "png", optimize=True)
    return out.getvalue()


def _checked(path: str | Path, suffix: str) -> Path:
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise InvalidInput(str(path), "name", f"does not end in {suffix}", "give it that suffix")
    return path


def _moment(film: Film, at: float | None) -> float:
    if at is None:
        return 0.5 * film.duration
    if not 0.0 <= at <= film.duration + 1e-9:
        raise InvalidInput(
            "still", "at", f"is {at!r} s", f"the film goes from 0 to {film.duration:g} s"
        )
    return float(at)
