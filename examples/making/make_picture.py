"""Make the README's pictures from a demo.

./run demo
./run render demo/bundle/run --turntable 24 --size 200 --format webp -o demo/turning
.venv/bin/python examples/making/make_picture.py demo docs

turn.png has the sheet above and below it views half way between its drawings; turning.webp turns;
demo-*.png are the pictures that the commands ask to be looked at.
"""

import shutil
import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT = 1200, 190
CAPTION = 28
INK = (70, 70, 70)


def over_white(path: Path) -> Image.Image:
    picture = Image.open(path).convert("RGBA")
    ground = Image.new("RGB", picture.size, "white")
    ground.paste(picture, mask=picture.getchannel("A"))
    return ground


def row(pictures: list[Image.Image]) -> Image.Image:
    """Return the pictures side by side, figures equally tall, in columns of one width."""
    strip = Image.new("RGB", (WIDTH, HEIGHT), "white")
    column = WIDTH // len(pictures)
    for i, picture in enumerate(pictures):
        box = Image.eval(picture.convert("L"), lambda value: 255 - value).getbbox()
        figure = picture.crop(box)
        scale = min((HEIGHT - 10) / figure.height, column / figure.width)
        size = (round(figure.width * scale), round(figure.height * scale))
        small = figure.resize(size, Image.Resampling.LANCZOS)
        strip.paste(small, (i * column + (column - size[0]) // 2, HEIGHT - 5 - size[1]))
    return strip


def main(demo: Path, docs: Path) -> None:
    save(turn(demo), docs / "turn.png")
    bundle = demo / "bundle"
    save(fitted(over_white(bundle / "overlay.png"), 1000), docs / "demo-overlay.png")
    save(fitted(over_white(bundle / "palette.png"), 500), docs / "demo-palette.png")
    shutil.copy(demo / "turning" / "turntable.webp", docs / "turning.webp")


def save(picture: Image.Image, path: Path) -> None:
    picture.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


def turn(demo: Path) -> Image.Image:
    drawn = [over_white(path) for path in sorted((demo / "bundle" / "images").glob("*.png"))]
    turned = sorted((demo / "turntable").glob("*.png"))
    step = len(turned) / len(drawn)
    rendered = [over_white(turned[int((i + 0.5) * step)]) for i in range(len(drawn))]
    captions = [
        f"in: {len(drawn)} drawings, cameras unknown",
        f"out: {len(rendered)} views that nobody drew, half way between them",
    ]
    return page(captions, [row(drawn), row(rendered)])


def fitted(picture: Image.Image, width: int) -> Image.Image:
    size = (width, round(picture.height * width / picture.width))
    return picture.resize(size, Image.Resampling.LANCZOS)


def page(captions: list[str], strips: list[Image.Image]) -> Image.Image:
    """Return pictures below each other, each with its caption."""
    height = sum(strip.height + CAPTION for strip in strips)
    whole = Image.new("RGB", (WIDTH, height), "white")
    pen, font, y = ImageDraw.Draw(whole), ImageFont.load_default(16), 0
    for caption, strip in zip(captions, strips, strict=True):
        pen.text((8, y + 4), caption, fill=INK, font=font)
        whole.paste(strip, (0, y + CAPTION - 2))
        y += strip.height + CAPTION
    return whole


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
