"""Make the README's picture from a demo: the sheet above, the turntable below.

./run demo && .venv/bin/python examples/make_picture.py demo docs/turn.png
"""

import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT, FRAMES = 1200, 190, 9
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


def main(demo: Path, out: Path) -> None:
    drawn = [over_white(path) for path in sorted((demo / "bundle" / "images").glob("*.png"))]
    turned = sorted((demo / "turntable").glob("*.png"))
    step = len(turned) / FRAMES
    rendered = [over_white(turned[round(i * step)]) for i in range(FRAMES)]
    page = Image.new("RGB", (WIDTH, 2 * HEIGHT + 56), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(16)
    captions = [
        f"in: {len(drawn)} drawings, cameras unknown",
        f"out: {FRAMES} of {len(turned)} rendered views, cameras found by toonset",
    ]
    for i, (caption, strip) in enumerate(zip(captions, (row(drawn), row(rendered)), strict=True)):
        pen.text((8, 4 + i * (HEIGHT + 28)), caption, fill=INK, font=font)
        page.paste(strip, (0, 26 + i * (HEIGHT + 28)))
    page.quantize(128, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
