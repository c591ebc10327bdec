"""The character's colours: every colour that covers 5 %, and which one each pixel has.

python examples/02_palette.py [FOLDER]    (default: ./out)

Prints the palette and writes FOLDER/labels.png, the first drawing in palette colours only.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import toonset as ts

HERE = Path(__file__).parent
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")

views = ts.split_sheet(HERE / "sheet.png").views
palette = ts.extract_palette(views, ts.PaletteOptions(min_share=0.05))
for color in palette.colors:
    print("#{:02x}{:02x}{:02x}".format(*color.rgb), f"{color.share:6.1%}  {color.name}")
for color in palette.dropped:
    print("left out: #{:02x}{:02x}{:02x}".format(*color.rgb), color.name)

labels = ts.label_image(views[0], palette)  # 255: background, or a blend of two colours
flat = np.full((*labels.shape, 3), 255, np.uint8)
flat[labels < 255] = palette.rgb[labels[labels < 255]]
out.mkdir(parents=True, exist_ok=True)
Image.fromarray(flat).save(out / "labels.png")
print("look at", out / "labels.png")
