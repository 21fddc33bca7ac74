"""A short film of a run: the exaggerated motion coloured by stress, as GIF (Pillow) or MP4 (ffmpeg)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import InputError, MissingDependency
from fcsim.files import replacing
from fcsim.running.folder import Instant, RunFolder
from fcsim.view.pictures import stress_frames
from fcsim.view.scene import Scene, Survey
from fcsim.view.style import STYLE, matplotlib

FORMATS = ("gif", "mp4")
MOST_FRAMES = 100
SECONDS = 8.0  # of a film of many frames; one of few frames is shorter
PAUSE = 1.5  # on the last frame of a GIF, which then begins again [s]
GIF_BYTES = 8_000_000
WIDTHS = {"gif": 900, "mp4": 1280}  # [pixel]


def film_instants(run: RunFolder) -> tuple[Instant, ...]:
    """Return at most 100 instants of the run, evenly spread, with the first and the last."""
    n = len(run.instants)
    return tuple(run.instants[k] for k in np.unique(np.linspace(0, n - 1, min(n, MOST_FRAMES)).round().astype(int)))


def write_film(
    run: RunFolder,
    seen: Survey,
    path: Path,
    format: Literal["gif", "mp4"] = "gif",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write the film to `path`, under a temporary name that is then renamed.

    Raises InputError for another format, MissingDependency without Pillow (GIF) or imageio-ffmpeg (MP4).
    """
    if format not in FORMATS:
        raise InputError(f"film: expected a format among {', '.join(FORMATS)}, got {format!r}")
    instants = film_instants(run)
    frames_per_second = float(np.clip(len(instants) / SECONDS, 6, 12.5))
    frames = _frames(run, seen, instants, WIDTHS[format], progress)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary, matplotlib().rc_context(STYLE):
        (_write_gif if format == "gif" else _write_mp4)(temporary, frames, frames_per_second)
    return path


def _frames(
    run: RunFolder, seen: Survey, instants: tuple[Instant, ...], width: int, progress: Callable[[int, int], None]
) -> Iterator[NDArray[np.uint8]]:
    with Scene(seen, width=width) as scene:
        for number, image in enumerate(stress_frames(run, scene, instants)):
            yield np.ascontiguousarray(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])
            progress(number + 1, len(instants))


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], frames_per_second: float) -> None:
    try:
        from PIL import Image
    except ImportError as error:
        raise MissingDependency(f"Pillow cannot be imported ({error}), which a GIF needs: pip install 'fcsim[view]'") from None
    images = [Image.fromarray(frame) for frame in frames]
    durations = [round(1000 / frames_per_second)] * (len(images) - 1) + [round(1000 * PAUSE)]
    while True:
        # one palette for all frames, from two of them: nothing flickers, and equal pixels stay equal from frame to frame
        samples = [
            images[k].resize((images[k].width // 2, images[k].height // 2), Image.Resampling.NEAREST) for k in (len(images) // 2, -1)
        ]
        both = Image.new("RGB", (samples[0].width, 2 * samples[0].height))
        for place, sample in enumerate(samples):
            both.paste(sample, (0, place * sample.height))
        palette = both.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=2)  # the stress's colours however few pixels have them
        first, *rest = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        first.save(path, format="GIF", save_all=True, append_images=rest, duration=durations, loop=0, optimize=False, disposal=1)
        if path.stat().st_size <= GIF_BYTES or images[0].width < 300:
            return
        images = [image.resize((image.width * 4 // 5, image.height * 4 // 5), Image.Resampling.LANCZOS) for image in images]


def _write_mp4(path: Path, frames: Iterator[NDArray[np.uint8]], frames_per_second: float) -> None:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise MissingDependency(f"imageio-ffmpeg cannot be imported ({error}), which an MP4 needs: pip install 'fcsim[view]'") from None
    first = next(frames)
    size = (first.shape[1], first.shape[0])
    # the temporary name has no suffix that ffmpeg knows, so the container is named; even sizes: no macro blocks to fill
    writer = imageio_ffmpeg.write_frames(
        str(path),
        size,
        fps=frames_per_second,
        codec="libx264",
        quality=8,
        macro_block_size=2,
        output_params=["-f", "mp4", "-movflags", "+faststart"],
    )
    writer.send(None)
    try:
        writer.send(first)
        for frame in frames:
            writer.send(frame)
    finally:
        writer.close()
