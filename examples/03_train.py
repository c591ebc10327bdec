"""From a bundle to a radiance field: train on its drawings, write a run.

python examples/03_train.py [FOLDER [STEPS]]    (default: ./out, 600)

Needs 01_sheet_to_cameras.py first. Look at FOLDER/run/preview.png.
"""

import sys
from pathlib import Path

import toonset as ts

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
steps = int(sys.argv[2]) if len(sys.argv) > 2 else 600

bundle = ts.read_bundle(out / "bundle")
run = ts.train(bundle.scene, ts.TrainOptions(steps=steps, seed=0))
metrics = run.save(out / "run", force=True)
print(f"{metrics['steps']} steps, {metrics['train']['psnr']:.1f} dB beside the drawings")
print("verdict:", metrics["verdict"]["verdict"], *metrics["verdict"]["reasons"])
print("look at", out / "run" / "preview.png")
