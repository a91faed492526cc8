"""Shrink the figures of `make reproduce` to the images of docs/online.md.

`python docs/online_pictures.py build/reproductions`
"""

import sys
from pathlib import Path

from PIL import Image

PICTURES = {
    "online_stages/figure-5.5-clusters.png": "online-stages.png",
    "online_zshape/figure-5.4-orders.png": "online-zshape.png",
    "online_dimensions/figure-5.8-dimensions.png": "online-dimensions.png",
}
COLOURS, MAX_SIZE = 64, 1100  # pixels

figures = Path(sys.argv[1])
for figure, name in PICTURES.items():
    with Image.open(figures / figure) as picture:
        picture.thumbnail((MAX_SIZE, MAX_SIZE))
        picture.convert("RGB").quantize(COLOURS).save(Path(__file__).parent / name, optimize=True)
