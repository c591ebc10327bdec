"""From a sheet to cameras: split the drawings, fit the mannequin, write a bundle.

python examples/01_sheet_to_cameras.py [FOLDER]    (default: ./out)

Look at FOLDER/bundle/overlay.png: the mannequin's outline should lie on every drawing.
"""

import math
import sys
from pathlib import Path

import toonset as ts

HERE = Path(__file__).parent
out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")

sheet = ts.split_sheet(HERE / "sheet.png")
for warning in sheet.warnings:
    print("look:", warning)

found = ts.calibrate(sheet.views, ts.load_mesh(HERE / "mannequin.obj"))
for view in found.views:
    yaw, elevation, _ = (math.degrees(angle) for angle in view.camera.angles)
    sigma = math.degrees(view.sigmas.yaw)
    print(f"{view.name}  yaw {yaw % 360:5.1f} +- {sigma:.1f}  {elevation:4.1f} up  {view.verdict}")
print("sheet:", found.verdict, found.reason)

bundle = ts.write_bundle(out / "bundle", found, force=True)
print("look at", bundle.folder / "overlay.png")
