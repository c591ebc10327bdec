"""The page's controls, used as a reader uses them."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest

from tests.apps.web.viewer.conftest import Open
from tests.apps.web.viewer.page_under_test import COLORS, PEN, SIZE_WH, Viewer, figure_scene
from toonset.palette.formats.adobe import read_ase, to_ase
from toonset.palette.formats.gpl import to_gpl
from toonset.palette.formats.hex import to_hex
from toonset.palette.palette import Palette, PaletteColor

NEW = ((10, 20, 30), (40, 50, 60), (70, 80, 90))
POSE = ("yaw", "elevation", "zoom", "pan")
START = {"yaw": 0, "elevation": 0, "zoom": 1, "pan": [0, 0]}


def pose(viewer: Viewer) -> dict[str, Any]:
    return {name: viewer.state[name] for name in POSE}


# Turning


def test_a_drag_turns_the_figure_with_the_pointer_and_moves_it_with_shift(open_page: Open) -> None:
    viewer = open_page()
    viewer.drag(60, 40)
    assert viewer.state["yaw"] < -10  # its front goes to the right
    assert 10 < viewer.state["elevation"] < 30  # and down
    viewer.drag(0, 2000)
    assert viewer.state["elevation"] == 30  # no view is higher
    assert viewer.sight["level"] == 1
    yaw = viewer.state["yaw"]
    viewer.page.keyboard.down("Shift")
    viewer.drag(50, 0)
    assert viewer.state["yaw"] == yaw
    assert viewer.state["pan"][0] > 0.05


def test_the_nearest_view_is_shown_that_has_the_layer(open_page: Open) -> None:
    viewer = open_page()
    for yaw, layer, shown in ((12.0, "drawn", 10), (-13, "drawn", -15), (12, "normal", 15)):
        viewer.set(yaw=yaw, layer=layer)
        seen = math.degrees(viewer.sight["angles"][0])
        assert math.remainder(seen - shown, 360) == pytest.approx(0)
    viewer.set(yaw=40, elevation=20, layer="drawn")
    assert math.degrees(viewer.sight["angles"][0]) == pytest.approx(30)


def test_a_button_turns_it_until_something_else_does(open_page: Open) -> None:
    viewer = open_page()
    button = viewer.page.get_by_role("button", name="Turn", exact=True)
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    viewer.page.wait_for_timeout(500)
    assert viewer.state["yaw"] > 5
    viewer.page.locator("#view").focus()
    viewer.page.keyboard.press("ArrowRight")
    assert button.get_attribute("aria-pressed") == "false"
    yaw = viewer.state["yaw"]
    viewer.page.wait_for_timeout(200)
    assert viewer.state["yaw"] == yaw


def test_keys_turn_move_zoom_and_reset(open_page: Open) -> None:
    viewer = open_page()
    viewer.page.locator("#view").focus()
    for key in ("ArrowLeft", "ArrowDown", "Shift+ArrowRight", "+"):
        viewer.page.keyboard.press(key)
    assert viewer.state["yaw"] == 5
    assert viewer.state["elevation"] == 30
    assert viewer.state["zoom"] > 1
    assert viewer.state["pan"][0] > 0
    viewer.rest()
    label = viewer.page.locator("#view").get_attribute("aria-label")
    assert label is not None
    assert "yaw 0°, elevation 30°" in label  # the nearest view
    viewer.page.keyboard.press("-")
    assert viewer.state["zoom"] == pytest.approx(1)
    viewer.page.keyboard.press("Home")
    assert pose(viewer) == START


def test_the_wheel_zooms_about_the_pointer(open_page: Open) -> None:
    viewer = open_page()
    x, y = viewer.middle()
    viewer.page.mouse.move(x + 100, y)
    before = viewer.shot["camera"]
    viewer.page.mouse.wheel(0, -300)
    viewer.rest()
    after = viewer.shot["camera"]
    assert after["scale"] > before["scale"]
    under = before["center"][0] + 100  # the pixel under the pointer, as is the point it shows
    offsets = [(under - camera["center"][0]) / camera["scale"] for camera in (before, after)]
    assert offsets[0] == pytest.approx(offsets[1], abs=0.01)
    viewer.page.mouse.dblclick(x, y)
    assert pose(viewer) == START


def test_fingers_turn_zoom_and_move(open_page: Open) -> None:
    viewer = open_page(has_touch=True, viewport={"width": 360, "height": 740})
    session = viewer.page.context.new_cdp_session(viewer.page)
    x, y = viewer.middle()

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": u, "y": v, "id": i} for i, (u, v) in enumerate(places)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (x, y))
    touch("touchMove", (x + 40, y))
    touch("touchEnd")
    assert viewer.state["yaw"] < -10
    yaw = viewer.state["yaw"]
    touch("touchStart", (x - 30, y), (x + 30, y))
    touch("touchMove", (x - 50, y + 20), (x + 70, y + 20))
    touch("touchEnd")
    assert viewer.state["yaw"] == yaw
    assert viewer.state["zoom"] == pytest.approx(2, rel=0.05)
    assert viewer.state["pan"][1] > 0.02


def test_a_swing_ends_by_itself(open_page: Open) -> None:
    viewer = open_page(reduced_motion="no-preference")
    for _ in range(9):  # a slow machine lets go too late for a swing
        viewer.drag(80, 0, pause_ms=0)
        let_go = viewer.state["yaw"]
        viewer.page.wait_for_timeout(50)
        if viewer.state["yaw"] < let_go:
            break
    else:
        pytest.fail("the figure stops where it is let go")
    viewer.page.wait_for_timeout(1500)
    rested = viewer.state["yaw"]
    viewer.page.wait_for_timeout(300)
    assert viewer.state["yaw"] == rested


def test_there_is_no_swing_where_less_motion_is_wished_for(open_page: Open) -> None:
    viewer = open_page(reduced_motion="reduce")
    for _ in range(3):
        viewer.drag(80, 0, pause_ms=0)
        let_go = viewer.state["yaw"]
        viewer.page.wait_for_timeout(100)
        assert viewer.state["yaw"] == let_go


def test_the_canvas_has_the_screens_pixels_up_to_two_for_one(open_page: Open) -> None:
    for density, expected in ((1, 1), (3, 2)):
        viewer = open_page(device_scale_factor=density)
        viewer.rest()
        width = viewer.page.evaluate("document.getElementById('stage').clientWidth")
        assert viewer.shot["camera"]["size"][0] == expected * width
    viewer.page.set_viewport_size({"width": 500, "height": 700})
    viewer.rest()
    assert viewer.shot["camera"]["size"][0] < 1000


# Layers and colours


def test_layers_are_a_radio_group_and_a_recoloured_paint_is_undone(open_page: Open) -> None:
    viewer = open_page()
    page = viewer.page
    page.get_by_role("radio", name="Normals").check()
    viewer.rest()
    assert viewer.shot["layer"] == "normal"
    assert viewer.pixel(0.5, 0.6)[:3] == [40, 40, 40]
    page.keyboard.press("ArrowRight")
    assert viewer.state["layer"] == "depth"
    page.get_by_label("red").fill("#00ff00")
    page.locator("#swatches").get_by_label("Lines").fill("#0000ff")
    page.get_by_role("radio", name="Drawn").check()
    viewer.rest()
    assert viewer.pixel(0.5, 0.6) == [0, 255, 0, 255]
    assert viewer.shot["pen"] == [0, 0, 255]
    page.get_by_role("button", name="Undo").click()
    assert viewer.state["ink"] == PEN
    assert viewer.state["colors"][0] == [0, 255, 0]
    page.keyboard.press("Control+z")
    assert viewer.state["colors"] == list(COLORS)
    assert page.get_by_role("button", name="Undo").is_disabled()
    page.get_by_role("button", name="Redo").click()
    page.keyboard.press("Control+Shift+Z")
    assert viewer.state["ink"] == [0, 0, 255]
    page.get_by_role("button", name="Reset", exact=True).click()
    assert (viewer.state["colors"], viewer.state["ink"]) == (list(COLORS), PEN)
    page.get_by_role("button", name="Undo").click()
    assert viewer.state["colors"][0] == [0, 255, 0]


def ase(*colors: tuple[str, tuple[float, ...]], tail: bytes = b"") -> bytes:
    """Return an Adobe Swatch Exchange file in one group."""
    blocks = [struct.pack(">HIH", 0xC001, 6, 2) + "g\0".encode("utf-16-be")]
    for model, parts in colors:
        name = "née\0".encode("utf-16-be")
        content = struct.pack(">H", len(name) // 2) + name + model.ljust(4).encode()
        content += struct.pack(f">{len(parts)}fH", *parts, 2)
        blocks.append(struct.pack(">HI", 1, len(content)) + content)
    blocks.append(struct.pack(">HI", 0xC002, 0))
    return b"ASEF" + struct.pack(">HHI", 1, 0, len(blocks)) + b"".join(blocks) + tail


def made_palette() -> Palette:
    colors = (PaletteColor(rgb, 1 / 3, name) for rgb, name in zip(NEW, "abc", strict=True))
    return Palette(tuple(colors), "made up", (), ())


def test_a_dropped_palette_replaces_the_colours(open_page: Open) -> None:
    viewer = open_page()
    palette = made_palette()
    files = {"a.gpl": to_gpl(palette).encode(), "a.HEX": to_hex(palette).encode()}
    for name, data in {**files, "a.ase": to_ase(palette)}.items():
        viewer.page.get_by_role("button", name="Reset", exact=True).click()
        assert viewer.drop(name, data) == f"{name}: 3 colours taken."
        assert viewer.state["colors"] == [list(rgb) for rgb in NEW], name
    viewer.page.get_by_role("button", name="Undo").click()
    assert viewer.state["colors"] == list(COLORS)
    said = viewer.drop("a.hex", b"#123456\r\n\r\n; no more\r\n")
    assert said == "a.hex: 1 colour for 3 paints; the other paints keep theirs."
    assert viewer.state["colors"] == [[0x12, 0x34, 0x56], *COLORS[1:]]
    said = viewer.drop("a.hex", b"fff\n" * 5)
    assert said == "a.hex: 5 colours for 3 paints; the rest is not used."
    assert viewer.state["colors"] == [[255, 255, 255]] * 3


def test_swatches_of_every_model_are_read(open_page: Open) -> None:
    viewer = open_page()
    data = ase(("LAB", (0.6, 40.0, -30.0)), ("Gray", (0.5,)), ("RGB", (1.0, 0.5, 0.0)))
    viewer.drop("a.ase", data)
    assert viewer.state["colors"] == [list(color.rgb) for color in read_ase(data, "a.ase")]
    said = viewer.drop("a.ase", ase(("CMYK", (0.0, 1.0, 0.5, 0.2))))
    assert said.endswith("CMYK colours are approximate.")
    assert viewer.state["colors"][0] == [204, 0, 102]


BROKEN = {
    "no.gpl": b"red green blue\n",
    "line.gpl": b"GIMP Palette\n1 2 300 x\n",
    "empty.gpl": b"GIMP Palette\n#\n",
    "line.hex": b"123456\nred\n",
    "empty.hex": b"",
    "zero.hex": b"\0\1\2",
    "no.ase": b"RIFF",
    "cut.ase": ase(("RGB", (1.0, 0.0, 0.0)))[:-20],
    "long.ase": b"ASEF" + struct.pack(">HHIHI", 1, 0, 1, 1, 0xFFFFFFFF),
    "name.ase": b"ASEF" + struct.pack(">HHIHIHH", 1, 0, 1, 1, 4, 0xFFFF, 0),
    "model.ase": ase(("HSB", (1.0, 0.0, 0.0))),
    "proto.ase": ase(("__pr", (1.0, 0.0, 0.0))),
    "nan.ase": ase(("RGB", (float("nan"), 0.0, 0.0))),
    "many.ase": b"ASEF" + struct.pack(">HHI", 1, 0, 0xFFFFFFFF),
    "large.hex": b"123456\n" * 200_000,
    "other.png": b"\x89PNG",
}


def test_broken_palettes_are_refused_in_one_line(open_page: Open) -> None:
    viewer = open_page()
    for name, data in BROKEN.items():
        said = viewer.drop(name, data)
        assert said.startswith(f"{name}: "), name
        assert "\n" not in said
        assert "taken" not in said
        assert viewer.state["colors"] == list(COLORS), name


def test_a_long_palette_gives_what_is_needed_and_says_so(open_page: Open) -> None:
    viewer = open_page()
    many = "".join(f"{i:06x}\n" for i in range(300)).encode()
    said = viewer.drop("many.hex", many)
    assert said == "many.hex: 300 colours for 3 paints; the rest is not used."
    assert viewer.state["colors"] == [[0, 0, 0], [0, 0, 1], [0, 0, 2]]


def test_a_changed_paint_has_no_name_of_its_old_colour(open_page: Open) -> None:
    viewer = open_page()
    names = viewer.page.locator("#swatches .name")
    viewer.page.get_by_label("red").fill("#00ff00")
    assert names.all_inner_texts()[:3] == ["was red", "teal", "gold"]
    viewer.page.get_by_role("button", name="Undo").click()
    assert names.all_inner_texts()[0] == "red"


def test_what_no_drawing_shows_is_marked_when_asked(open_page: Open) -> None:
    viewer = open_page()
    spots = [(0.45, 0.4), (0.45, 0.6), (0.55, 0.6)]
    before = [viewer.pixel(*spot) for spot in spots]
    button = viewer.page.get_by_role("button", name="Not drawn")
    button.click()
    viewer.rest()
    after = [viewer.pixel(*spot) for spot in spots]
    assert after[0][2] > before[0][2] + 20  # bluer: mirrored
    assert after[1] != before[1]
    assert after[2] == before[2]
    words = viewer.page.locator("#origin_words").inner_text()
    assert "mirror image of a drawing (blue)" in words
    assert words.count(" %") == 2
    assert "0 %" not in words.split()
    button.click()
    viewer.rest()
    assert [viewer.pixel(*spot) for spot in spots] == before
    assert viewer.page.locator("#origin_words").is_hidden()


def test_it_turns_until_it_is_touched(open_page: Open) -> None:
    viewer = open_page(reduced_motion="no-preference")
    viewer.until("toonset.store.state.yaw > 5")
    viewer.page.locator("h1").click()
    yaw = viewer.state["yaw"]
    viewer.page.wait_for_timeout(300)
    assert viewer.state["yaw"] == yaw
    button = viewer.page.get_by_role("button", name="Turn", exact=True)
    assert button.get_attribute("aria-pressed") == "false"
    still = open_page("#yaw=40", reduced_motion="no-preference")  # a link's view stays
    still.page.wait_for_timeout(500)
    assert still.state["yaw"] == 40
    calm = open_page()
    calm.page.wait_for_timeout(500)
    assert calm.state["yaw"] == 0


def test_the_turn_button_stops_what_turns_by_itself(open_page: Open) -> None:
    viewer = open_page(reduced_motion="no-preference")
    viewer.until("toonset.store.state.yaw > 5")
    button = viewer.page.get_by_role("button", name="Turn", exact=True)
    button.click()
    assert button.get_attribute("aria-pressed") == "false"
    yaw = viewer.state["yaw"]
    viewer.page.wait_for_timeout(300)
    assert viewer.state["yaw"] == yaw


def test_the_stage_fills_the_screen_and_comes_back(open_page: Open) -> None:
    viewer = open_page()
    button = viewer.page.get_by_role("button", name="Full screen")
    button.click()
    viewer.until("document.fullscreenElement !== null")
    viewer.rest()
    size = viewer.page.evaluate("[innerWidth, innerHeight]")
    assert viewer.shot["camera"]["size"] == size
    assert button.get_attribute("aria-pressed") == "true"
    button.click()
    viewer.until("document.fullscreenElement === null")


def test_hints_about_keys_are_not_for_phones(open_page: Open) -> None:
    small = {"viewport": {"width": 360, "height": 740}, "has_touch": True}
    assert "arrow keys" not in open_page(**small).page.locator("#help").inner_text()
    assert "arrow keys" in open_page().page.locator("#help").inner_text()


# Drawings


def test_the_timeline_tells_verdicts_in_words(open_page: Open) -> None:
    viewer = open_page()
    buttons = viewer.page.locator("#drawings button")
    assert [text.split() for text in buttons.all_inner_texts()] == [
        ["000.png", "0°", "±", "4.0°", "✓", "ok"],
        ["001.png", "50°", "±", "24.0°", "~", "weak"],
        ["002.png", "180°", "±", "44.0°", "?", "ambiguous"],
        ["003.png", "270°", "✕", "failed"],
    ]
    buttons.nth(1).focus()
    assert viewer.page.locator("#reason").inner_text() == "Drawing 2: why it is weak"
    buttons.nth(3).click()
    assert viewer.state["snapped"] == 3
    assert viewer.page.locator("#reason").inner_text() == "Drawing 4: why it is failed"
    assert "no drawing shows the left side" in viewer.page.locator("#verdict").inner_text()


def test_a_drawings_camera_is_the_stages(open_page: Open) -> None:
    viewer = open_page()
    viewer.page.locator("#drawings button").nth(1).click()
    viewer.rest()
    camera, drawn = viewer.shot["camera"], figure_scene()[0]["views"][1]["camera"]
    assert math.degrees(viewer.sight["angles"][0]) == pytest.approx(50)  # no ring has its elevation
    factor = camera["scale"] / drawn["scale"]
    assert camera["rotation"] == drawn["rotation"]
    for axis in (0, 1):  # the drawing lies in the stage's middle, and the figure in the drawing
        left = (camera["size"][axis] - SIZE_WH[axis] * factor) / 2
        assert camera["center"][axis] == pytest.approx(left + drawn["center"][axis] * factor)
    assert SIZE_WH[1] * factor == pytest.approx(0.94 * camera["size"][1])
    viewer.page.locator("#view").focus()
    viewer.page.keyboard.press("ArrowLeft")
    viewer.rest()
    freed = viewer.shot["camera"]
    assert viewer.state["yaw"] == pytest.approx(55)
    assert viewer.state["elevation"] == pytest.approx(5)
    assert freed["scale"] == pytest.approx(camera["scale"])  # nothing jumps
    assert freed["center"] == pytest.approx(camera["center"])
    assert viewer.page.locator("#compare").is_hidden()
    assert viewer.page.locator("#overlay").is_hidden()


def overlay_pixel(viewer: Viewer, u: float, v: float) -> list[int]:
    return viewer.page.evaluate(
        """([u, v]) => {
          const overlay = document.getElementById("overlay");
          const copy = new OffscreenCanvas(1, 1).getContext("2d");
          copy.drawImage(overlay, -Math.floor(u * overlay.width), -Math.floor(v * overlay.height));
          return [...copy.getImageData(0, 0, 1, 1).data];
        }""",
        [u, v],
    )


def test_a_drawing_is_compared_in_four_ways(open_page: Open) -> None:
    viewer = open_page()
    page = viewer.page
    page.locator("#drawings button").nth(0).click()
    slider = page.get_by_role("slider", name="Drawing on the left")
    slider.focus()
    for key in ("ArrowLeft", "PageDown", "ArrowRight", "ArrowRight"):
        page.keyboard.press(key)
    assert slider.get_attribute("aria-valuenow") == "42"
    assert slider.get_attribute("aria-valuetext") == "42 % drawing"
    page.keyboard.press("End")
    assert viewer.state["split"] == 1
    page.keyboard.press("Home")
    assert viewer.state["split"] == 0
    viewer.set(split=0.5)
    x, y = viewer.middle()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 100, y, steps=3)
    page.mouse.up()
    assert 0 < viewer.state["split"] < 0.5
    assert viewer.state["snapped"] == 0
    assert overlay_pixel(viewer, 0.5, 0.5)[3] == 128
    assert overlay_pixel(viewer, 0.5, 0.5)[0] == pytest.approx(199, abs=2)  # 100 of 128

    page.get_by_role("radio", name="Side by side").check()
    viewer.rest()
    width = viewer.shot["camera"]["size"][0]
    assert viewer.shot["camera"]["center"][0] == pytest.approx(0.75 * width, abs=2)
    assert overlay_pixel(viewer, 0.25, 0.5)[3] == 128
    assert overlay_pixel(viewer, 0.75, 0.5)[3] == 0

    page.get_by_role("radio", name="Onion skin").check()
    page.get_by_role("slider", name="Drawing", exact=True).fill("30")
    assert page.locator("#overlay").evaluate("e => e.style.opacity") == "0.3"

    page.get_by_role("radio", name="Difference").check()
    blend = "e => getComputedStyle(e).mixBlendMode"
    assert page.locator("#overlay").evaluate(blend) == "difference"
    page.get_by_role("button", name="Done").click()
    assert page.locator("#overlay").is_hidden()
    assert viewer.state["snapped"] == -1


def test_cameras_stand_round_the_figure(open_page: Open) -> None:
    viewer = open_page("#yaw=20")
    page = viewer.page
    assert page.locator("#frusta_front").is_hidden()
    page.get_by_role("button", name="Cameras").click()
    paths = "[...document.querySelectorAll('.frusta path')].filter(p => p.getAttribute('d'))"
    assert page.evaluate(f"{paths}.length") == 4
    outside = """paths => { const stage = document.getElementById("stage").getBoundingClientRect();
      return paths.map(p => p.getBoundingClientRect()).filter(b => b.left < stage.left
        || b.right > stage.right || b.top < stage.top || b.bottom > stage.bottom).length; }"""
    assert page.evaluate(f"({outside})({paths})") == 0
    page.locator("#frusta_front circle").nth(1).click()
    assert viewer.state["snapped"] == 1
    assert page.locator("#frusta_front").is_hidden()
