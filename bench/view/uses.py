"""What readers do with a page: twenty ways, from a drag to a lost graphics context."""

from __future__ import annotations

from urllib.parse import quote

from bench.view.reader import Reader
from toonset.palette.formats.adobe import to_ase
from toonset.palette.formats.gpl import to_gpl
from toonset.palette.formats.hex import to_hex
from toonset.palette.palette import Palette, PaletteColor

HOSTILE = (
    "</script><script>globalThis.pwned = 1</script>",
    "\"'><img src=x onerror=globalThis.pwned=1>",
    "\u202eright to left\u2067 \u05d0\u05d1",
    "\x1b[31mred\x1b[0m",
    "x" * 10_000,
)
LOSE = """async () => {
  const loss = view.getContext("webgl2").getExtension("WEBGL_lose_context");
  const hear = name => new Promise(done => view.addEventListener(name, done, { once: true }));
  const [lost, back] = ["lost", "restored"].map(word => hear("webglcontext" + word));
  loss.loseContext();
  await lost;
  setTimeout(() => loss.restoreContext(), 100);
  await back;
}"""


def drags(reader: Reader) -> None:
    """Turn the figure by hand, in all directions, and move it."""
    for x, y in ((200, 0), (-300, 90), (40, -300), (0, 2000)):
        reader.drag(x, y)
    reader.page.keyboard.down("Shift")
    reader.drag(80, 40)
    reader.page.keyboard.up("Shift")


def touches(reader: Reader) -> None:
    """Turn it with one finger."""
    reader.touch("touchStart", (0, 0))
    for x in range(0, 120, 20):
        reader.touch("touchMove", (x, x / 3))
    reader.touch("touchEnd")


def pinches(reader: Reader) -> None:
    """Zoom with two fingers."""
    for ends in ((20, 120), (120, 10)):
        reader.touch("touchStart", (-ends[0], 0), (ends[0], 0))
        reader.touch("touchMove", (-ends[1], 30), (ends[1], 30))
        reader.touch("touchEnd")


def wheels(reader: Reader) -> None:
    """Zoom by wheel and by buttons."""
    reader.page.mouse.move(*reader.middle())
    for y in (-300, -9000, 20000):
        reader.page.mouse.wheel(0, y)
    for name in ("Closer", "Farther", "Reset the view"):
        reader.click(name)


def types(reader: Reader) -> None:
    """Press keys, on the figure and all over the page."""
    reader.keys("ArrowLeft", "Shift+ArrowUp", "+", "=", "-", "_", "Home", "Escape", "PageDown", "a")
    for _ in range(60):  # round the page, whatever has the focus
        reader.page.keyboard.press("Tab")


def sees_layers(reader: Reader) -> None:
    """Look at every layer."""
    for radio in reader.page.locator("#layers input").all():
        radio.check(force=True)
        reader.wait()


def compares(reader: Reader) -> None:
    """Compare every drawing in every way."""
    for drawing in reader.page.locator("#drawings button").all():
        drawing.click()
        for radio in reader.page.locator("#comparisons input").all():
            radio.check(force=True)
    reader.page.locator("#onion").evaluate("one => one.stepUp(9)")
    reader.page.get_by_role("radio", name="Slider").check(force=True)
    reader.page.locator("#split").focus()
    for key in ("End", "Home", "PageUp", "ArrowLeft"):
        reader.page.keyboard.press(key)
    reader.click("Done")


def sees_cameras(reader: Reader) -> None:
    """Look at the cameras, and choose one."""
    reader.click("Cameras")
    reader.drag(150, 60)
    reader.page.locator("#frusta_front circle").first.click(force=True)
    reader.wait()


def recolours(reader: Reader) -> None:
    """Choose other colours, undo, redo and reset."""
    for i, row in enumerate(reader.page.locator("#swatches input").all()):
        row.fill(f"#{0x10FF40 + 4000 * i:06x}")
    for name in ("Undo", "Redo", "Reset", "Undo"):
        reader.click(name)
    reader.keys("Control+z", "Control+y", "Control+Shift+z")
    reader.click("Copy hex list")


def drops_palettes(reader: Reader) -> None:
    """Drop a palette of each format."""
    count = reader.page.locator("#swatches input").count()
    colors = (PaletteColor((9 * i, 250 - 9 * i, 99), 1 / count, f"{i}") for i in range(count))
    palette = Palette(tuple(colors), "made up", (), ())
    reader.drop("a.gpl", to_gpl(palette).encode())
    reader.drop("a.hex", to_hex(palette).encode())
    reader.drop("a.ase", to_ase(palette))


def drops_rubbish(reader: Reader) -> None:
    """Drop files that are no palettes."""
    for data in (b"", b"\0\xff" * 999, b"GIMP Palette\n1 2 300 x\n", b"ASEF" + b"\xff" * 99):
        for name in ("a.gpl", "b.hex", "c.ase", "d.png", HOSTILE[1], HOSTILE[4] + ".hex"):
            reader.drop(name, data)


def saves(reader: Reader) -> None:
    """Save a picture of each size."""
    for size in ("1", "2", "4"):
        reader.page.locator("#factor").select_option(size)
        reader.save("Save PNG")


def saves_a_turn(reader: Reader) -> None:
    """Save the turntable."""
    reader.save("Save turntable")


def copies_links(reader: Reader) -> None:
    """Copy a link, and load the page anew."""
    reader.keys("ArrowLeft", "+")
    reader.click("Copy link")
    reader.wait()
    reader.page.reload()


def follows_links(reader: Reader) -> None:
    """Follow links that say nothing sensible."""
    keys = "yaw zoom pan layer colors ink view compare cameras __proto__".split()
    for text in (*HOSTILE, *map(quote, HOSTILE), "NaN", "1e999", "-1"):
        hash = "&".join(f"{key}={text}" for key in keys)
        reader.page.evaluate("hash => { location.hash = hash; }", hash)
        reader.wait(50)


def resizes(reader: Reader) -> None:
    """Change the window's size, by day and by night."""
    for width, height in ((360, 740), (1600, 300), (800, 1200), (240, 240)):
        reader.page.set_viewport_size({"width": width, "height": height})
        reader.page.emulate_media(color_scheme="dark" if width > 800 else "light")
        reader.wait()


def reads_from_right_to_left(reader: Reader) -> None:
    """Use a page whose language is written from right to left."""
    reader.page.evaluate("document.documentElement.dir = 'rtl'")
    for use in (drags, compares, recolours):
        use(reader)
    assert reader.page.evaluate("document.documentElement.scrollWidth") == 360


def loses_its_context(reader: Reader) -> None:
    """Lose the graphics context, twice, and get it back."""
    for _ in range(2):
        reader.page.evaluate(LOSE)
        reader.page.wait_for_selector("#poster[hidden]", state="attached")
    sees_layers(reader)


def does_all_it_can(reader: Reader) -> None:
    """Do what a page can that does not draw in 3D."""
    drags(reader)
    compares(reader)
    reader.click("Copy hex list")


def reads_hostile_names(reader: Reader) -> None:
    """Use a page whose names mean harm."""
    compares(reader)
    reader.save("Save PNG")
    assert reader.page.evaluate("globalThis.pwned") is None
