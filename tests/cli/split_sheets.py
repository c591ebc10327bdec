"""A sheet of figures in four colours, drawn with Pillow."""

from PIL import Image, ImageDraw

COLORS = ((200, 60, 40), (40, 120, 200), (60, 160, 70), (220, 180, 40))
COUNT = len(COLORS)
PITCH, TOP, WIDE, HIGH = 110, 20, 60, 160  # of the figures on the sheet


def draw_figure(pen: ImageDraw.ImageDraw, x: int, y: int, color: tuple[int, int, int]) -> None:
    pen.ellipse((x + 10, y, x + 50, y + 45), color, "black", 3)
    pen.rectangle((x, y + 43, x + WIDE, y + 110), color, "black", 3)
    pen.rectangle((x + 8, y + 108, x + 26, y + HIGH), color, "black", 3)
    pen.rectangle((x + 34, y + 108, x + 52, y + HIGH), color, "black", 3)


def drawn_sheet(paper: str = "white", colors: tuple[tuple[int, int, int], ...] = COLORS):
    image = Image.new("RGB", (PITCH * len(colors), HIGH + 2 * TOP), paper)
    pen = ImageDraw.Draw(image)
    for number, color in enumerate(colors):
        draw_figure(pen, 25 + PITCH * number, TOP, color)
    return image
