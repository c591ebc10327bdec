"""New views: render the field all round, and take a mesh out of it.

python examples/05_turntable.py [FOLDER [VIEWS]]    (default: ./out, 12)

Needs 03_train.py first. Look at FOLDER/turn/000.png and what follows it.
"""

import sys
from pathlib import Path

import toonset as ts

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
views = int(sys.argv[2]) if len(sys.argv) > 2 else 12

field = ts.read_run(out / "run")
for i, camera in enumerate(ts.turntable(field, views, elevation=0.15)):  # radians
    ts.render(field, camera).save(out / "turn" / f"{i:03d}.png", layer="palette")
ts.surface_of(field, faces=5000).save(out / "figure.glb", force=True)
print("look at", out / "turn", "and", out / "figure.glb")
