"""The pictures of docs/online.md out of those that `make reproduce` drew, small enough to be kept.

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
COLOURS, LONGEST = 64, 1100  # pixels

drawn = Path(sys.argv[1])
for name, small in PICTURES.items():
    with Image.open(drawn / name) as picture:
        picture.thumbnail((LONGEST, LONGEST))
        picture.convert("RGB").quantize(COLOURS).save(Path(__file__).parent / small, optimize=True)
