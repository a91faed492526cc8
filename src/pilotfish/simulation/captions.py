"""Captions in the images of a film: the title, the time, the phase of the task and the outcome."""

from collections.abc import Sequence

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, UInt8

FONT_HEIGHT, MARGIN = 0.04, 0.4  # of the height of the image; of the height of the font
BAND, WHITE, GREEN, RED = (25, 28, 33), (255, 255, 255), (140, 225, 150), (255, 150, 140)
Image = UInt8[Array, "H W 3"]


def caption_images(
    images: Sequence[Image],
    times: Sequence[float],
    phases: Sequence[str],
    *,
    title: str,
    outcome: str,
    success: bool,
) -> list[Image]:
    """Return images with two bands: title and outcome above, time and phase below.

    Args:
        images: Images of one size.
        times: Time of each image [s].
        phases: What happens in each image.
        title: Task and situation, the same in all images.
        outcome: Result at the end, the same in all images.
        success: Whether the result is a success: green, otherwise red.

    Raises:
        InvalidInput: If there is not a time and a phase for each image.
    """
    if not len(images) == len(times) == len(phases):
        raise InvalidInput(
            f"there are {len(times)} times and {len(phases)} phases, expected {len(images)} of each, one for "
            "each image"
        )
    colour = GREEN if success else RED
    return [
        _caption_image(image, ((title, outcome, colour), (f"{time:.1f} s", phase, WHITE)))
        for image, time, phase in zip(images, times, phases, strict=True)
    ]


def _caption_image(image: Image, lines: tuple[tuple[str, str, tuple[int, int, int]], ...]) -> Image:
    """Draw a band with a left and a right text at the top, and another at the bottom."""
    from PIL.Image import fromarray
    from PIL.ImageDraw import Draw
    from PIL.ImageFont import load_default

    height, width, _ = image.shape
    size = max(FONT_HEIGHT * height, 8.0)
    margin, font, picture = MARGIN * size, load_default(size), fromarray(image)
    draw, band = Draw(picture), round(size * (1.0 + 2.0 * MARGIN))
    for top, (left, right, colour) in zip((0, height - band), lines, strict=True):
        draw.rectangle((0, top, width, top + band - 1), fill=BAND)
        middle = top + band / 2
        draw.text((2 * margin, middle), left, fill=WHITE, font=font, anchor="lm")
        draw.text((width - 2 * margin, middle), right, fill=colour, font=font, anchor="rm")
    return np.asarray(picture)
