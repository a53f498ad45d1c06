#!/usr/bin/env python3
"""The pictures of docs/gallery from reports of grassfire.

    gallery.py GALLERY NAME=RESULT [NAME=RESULT ...]

RESULT is a result folder with its report.html. Writes GALLERY/NAME_skeleton.png, NAME_quads.png and NAME_distance.png, 640
pixels wide or smaller, so that each fits into 60 kB. Needs Pillow.
"""
import base64
import io
import os
import re
import sys

from PIL import Image

# Fewer colours, or those of a median cut, turn the ends of colour scales grey: rather a smaller picture.
WIDTHS = (640, 560, 480, 400)
COLOURS = 128
MOST_BYTES = 60_000
PICTURES = {"Quad skeleton": "skeleton", "Body": "quads", "Deviation": "distance"}


def small(picture):
    """A palette PNG, as wide as its size allows."""
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    for width in WIDTHS:
        shrunk = image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        shrunk.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(out, "PNG", optimize=True)
        if out.tell() <= MOST_BYTES:
            break
    return out.getvalue()


def main():
    gallery = sys.argv[1]
    os.makedirs(gallery, exist_ok=True)
    for argument in sys.argv[2:]:
        name, result = argument.split("=", 1)
        with open(os.path.join(result, "report.html"), encoding="utf-8") as f:
            page = f.read()
        found = dict(re.findall(r'<img alt="([^"]+)" src="data:image/png;base64,([^"]+)"', page))
        for title, kind in PICTURES.items():
            if title not in found:
                sys.exit(f"{result}/report.html has no picture called {title}")
            picture = small(base64.b64decode(found[title]))
            path = os.path.join(gallery, f"{name}_{kind}.png")
            with open(path, "wb") as f:
                f.write(picture)
            print(f"{path}: {len(picture)} bytes")


main()
