"""The page as a file: figures, cameras, palette, as a person corrects them."""

import json
from pathlib import Path

import pytest

from tests.apps.web.editor.conftest import Open
from tests.apps.web.editor.page_under_test import BOXES, HEXES, HOSTILE, SIZE_WH, STUDY, Editor
from toonset.dataset.split_folder.corrections import parse_corrections


def is_valid(editor: Editor) -> bool:
    """Return whether the page's file is one that the command line takes."""
    data = json.dumps(editor.download()).encode()
    return parse_corrections(data, "page").version == 1


def test_a_box_is_drawn_moved_sized_and_dropped(editor: Editor) -> None:
    editor.mode("Figures")
    editor.drag((340, 20), (390, 150))
    assert len(editor.said["boxes"]) == 4
    drawn = editor.said["boxes"][3]
    assert drawn == pytest.approx([340, 20, 50, 130], abs=3)
    editor.drag((50, 100), (60, 105))
    moved = editor.said["boxes"][0]
    assert moved == pytest.approx([30, 45, 60, 120], abs=3)
    editor.drag((moved[0] + moved[2], moved[1] + moved[3]), (100, 180))
    assert editor.said["boxes"][0] == pytest.approx([30, 45, 70, 135], abs=3)
    editor.click("Drop")
    assert editor.views == [{"box": editor.said["boxes"][0], "exclude": True}]
    editor.click("Bring back")
    assert editor.views == []
    assert is_valid(editor)


def test_boxes_are_merged_and_cut(editor: Editor) -> None:
    editor.mode("Figures")
    editor.tap(50, 100)
    editor.page.keyboard.down("Shift")
    editor.tap(170, 100)
    editor.page.keyboard.up("Shift")
    editor.click("Merge")
    assert editor.said["boxes"] == [[20, 40, 180, 120], BOXES[2]]
    editor.click("Cut")
    editor.tap(110, 100)
    boxes = editor.said["boxes"]
    assert len(boxes) == 3
    assert boxes[0] == pytest.approx([20, 40, 90, 120], abs=2)
    assert boxes[1] == pytest.approx([110, 40, 90, 120], abs=2)
    assert is_valid(editor)
    editor.click("Undo")
    editor.tap(110, 100)
    editor.click("Cut")
    editor.page.keyboard.down("Shift")
    editor.tap(110, 100)
    editor.page.keyboard.up("Shift")
    assert editor.said["boxes"][0] == pytest.approx([20, 40, 180, 60], abs=2)


def test_what_was_left_out_is_named_and_comes_back(editor: Editor) -> None:
    editor.mode("Figures")
    editor.page.get_by_label("Take “a”, text, as a figure").click()
    assert editor.said["boxes"][3] == [300, 170, 90, 20]
    assert editor.page.locator("#left_out_row").is_hidden()
    editor.click("All as found")
    assert "boxes" not in editor.said
    assert editor.page.locator("#left_out_row").is_visible()


def test_a_group_and_a_row_are_taken_in_one_click(open_page: Open) -> None:
    kept = {"box": BOXES[2], "label": "back"}
    editor = open_page(
        {"version": 1, "views": [{"box": BOXES[0], "label": "front"}, kept]}, outfits=True
    )
    editor.mode("Figures")
    groups = editor.page.locator("#groups button")
    pressed = "[...document.querySelectorAll('#groups button')].map((one) => one.ariaPressed)"
    assert editor.page.evaluate(pressed) == ["true", "false", "false", "false"]
    groups.nth(2).focus()
    editor.page.keyboard.press("Enter")
    assert editor.said["outfit"] == "B"
    assert editor.views == [kept]  # what was said of the others goes
    assert editor.page.evaluate("toonset.model.figures.map((one) => one.box)") == [BOXES[2]]
    assert editor.page.evaluate(pressed) == ["false", "false", "true", "false"]
    assert editor.page.evaluate("document.activeElement.textContent") == "Outfit B"
    assert is_valid(editor)
    groups.nth(3).click()
    assert (editor.said["group"], "outfit" in editor.said) == (2, False)
    editor.drag((30, 20), (80, 150))  # who draws boxes says which figures count
    assert len(editor.said["boxes"]) == 2
    assert "group" not in editor.said
    assert is_valid(editor)
    for _ in range(3):
        editor.click("Undo")
    assert len(editor.views) == 2


def test_the_page_starts_with_the_groups_until_something_is_said(open_page: Open) -> None:
    assert open_page(outfits=True).page.locator("#groups").is_visible()
    assert open_page().page.locator("#groups").is_hidden()


def test_a_drawing_that_was_left_out_is_a_click_away(open_page: Open) -> None:
    editor = open_page(outfits=True)
    editor.tap(370, 30)
    assert editor.said["boxes"][3] == STUDY
    editor.click("All as found")
    assert "boxes" not in editor.said


@pytest.mark.parametrize(("width", "height"), [(1600, 1000), (1024, 700), (390, 800)])
def test_the_stage_is_as_large_as_the_window(open_page, width, height):
    page = open_page(viewport={"width": width, "height": height}).page
    box = page.locator("#stage").bounding_box()
    beside = 0 if width < 960 else max(320, 0.26 * width)
    assert box["width"] > width - beside - 60
    assert box["height"] > 0.7 * height


def test_captions_are_shown_until_a_person_says_otherwise(editor: Editor) -> None:
    card = editor.page.locator(".card").first
    assert "Its caption says front." in card.inner_text()
    assert editor.page.evaluate("toonset.nameOf(toonset.model.figures[0], 0)") == "1 front"
    editor.page.get_by_role("radio", name="its left side").first.check()
    assert editor.page.evaluate("toonset.nameOf(toonset.model.figures[0], 0)") == "1 left"


def test_the_paper_is_picked(editor: Editor) -> None:
    editor.mode("Figures")
    editor.page.locator("#pick_paper").click()
    editor.tap(50, 60)
    assert editor.said["background"] == HEXES[0]
    editor.page.locator("#find_paper").click()
    assert "background" not in editor.said


def test_keys_do_what_the_mouse_does(editor: Editor) -> None:
    editor.mode("Figures")
    editor.page.locator("#sheet").focus()
    editor.page.keyboard.press("ArrowRight")
    editor.page.keyboard.press("Shift+ArrowDown")
    assert editor.said["boxes"][0] == [22, 40, 60, 122]
    editor.page.keyboard.press("Delete")
    assert editor.views[0]["exclude"]


def test_compass_flip_lock_and_leaving_out(editor: Editor) -> None:
    shown = editor.page.locator(".card").nth(2).inner_text()
    assert all(words in shown for words in ("why it is ambiguous", "180° ± 45°"))
    compass = editor.page.get_by_role("radiogroup", name="Direction of drawing 2")
    compass.get_by_role("radio", name="back left").check()
    assert editor.views == [{"box": BOXES[1], "label": "back-left"}]
    editor.card("Flip", 2)
    assert editor.views == [{"box": BOXES[1], "label": "45"}]
    editor.page.get_by_label("Yaw of drawing 3, degrees").fill("200")
    editor.page.keyboard.press("Tab")
    assert editor.views[1] == {"box": BOXES[2], "label": "-160"}
    editor.card("Lock", 2)
    locked = next(view for view in editor.views if view["box"] == BOXES[1])
    assert locked == {"box": BOXES[1], "label": "45", "lock": True}
    editor.card("Lock", 1)  # nothing was said of it: it stays as it is fitted
    assert editor.views[-1]["camera"]["yaw"] == pytest.approx(0)
    editor.card("Leave out", 1)
    assert editor.views[-1]["exclude"]
    assert is_valid(editor)
    editor.card("As found", 1)
    assert len(editor.views) == 2


def test_the_mannequin_is_dragged_and_the_error_is_live(editor: Editor) -> None:
    error = editor.page.locator("#fit_error")
    editor.until("document.getElementById('fit_error').textContent.includes('%')")
    before = error.inner_text()
    assert float(before.split("by ")[1].split(" %")[0]) > 95  # the slab is as large as the drawing
    start = editor.place(40, 130)
    editor.page.mouse.move(*start)
    editor.page.mouse.down()
    editor.page.mouse.move(start[0] + 60, start[1], steps=4)
    editor.until(f"document.getElementById('fit_error').textContent !== {before!r}")
    assert editor.views == []  # it is not let go yet
    editor.page.mouse.up()
    camera = editor.views[0]["camera"]
    assert camera["yaw"] < -20  # its front goes with the pointer
    assert camera["scale"] == pytest.approx(100)
    assert camera["middle"] == pytest.approx([50, 100])
    editor.page.keyboard.down("Shift")
    editor.drag((40, 130), (46, 126))
    editor.page.keyboard.up("Shift")
    assert editor.views[0]["camera"]["middle"] == pytest.approx([56, 96], abs=1)
    editor.page.keyboard.down("Alt")
    editor.drag((40, 130), (40, 150))
    editor.page.keyboard.up("Alt")
    assert editor.views[0]["camera"]["elevation"] > 5
    assert is_valid(editor)


def test_a_strip_opens_enlarged_about_the_chosen_figure(open_page: Open) -> None:
    editor = open_page(viewport={"width": 500, "height": 1600})
    stage = editor.page.locator("#stage").bounding_box()
    assert stage is not None
    height = editor.place(0, SIZE_WH[1])[1] - editor.place(0, 0)[1]
    assert 0.4 * stage["height"] < height < 0.6 * stage["height"]
    x, _, wide, _ = BOXES[0]
    assert stage["x"] < editor.place(x, 0)[0] < editor.place(x + wide, 0)[0]
    assert editor.place(x + wide, 0)[0] < stage["x"] + stage["width"]
    editor.page.locator("#home").click()
    assert editor.place(SIZE_WH[0], 0)[0] <= stage["x"] + stage["width"]


def test_a_click_with_a_trembling_hand_turns_nothing(editor: Editor) -> None:
    x, y = editor.place(170, 100)
    editor.page.mouse.move(x, y)
    editor.page.mouse.down()
    editor.page.mouse.move(x + 2, y + 1)
    editor.page.mouse.up()
    assert editor.page.evaluate("toonset.model.selected") == 1
    assert editor.views == []


def test_keys_and_numbers_place_the_mannequin(editor: Editor) -> None:
    editor.page.locator("#sheet").focus()
    for key in ("ArrowLeft", "ArrowDown", "]", "+", "Shift+ArrowRight"):
        editor.page.keyboard.press(key)
    camera = editor.views[0]["camera"]
    assert (camera["yaw"], camera["elevation"], camera["roll"]) == (2, 2, 1)
    assert camera["scale"] == pytest.approx(101)
    assert camera["middle"] == pytest.approx([51, 100])
    editor.page.locator("#pose_yaw").fill("-30")
    editor.page.keyboard.press("Tab")
    assert editor.views[0]["camera"]["yaw"] == -30


def test_a_landmark_is_two_clicks(editor: Editor) -> None:
    editor.click("Add a landmark")
    editor.tap(40, 80)
    editor.tap(45, 85)
    mark = editor.views[0]["landmarks"][0]
    assert mark["pixel"] == pytest.approx([45, 85], abs=1)
    assert mark["world"] == pytest.approx([-0.1, 0.8, 0.1], abs=0.02)  # the slab's front
    editor.click("Forget landmarks")
    assert editor.views == []


def test_without_a_mannequin_there_are_compasses(open_page: Open) -> None:
    editor = open_page(body=False)
    assert editor.page.locator("#no_body").is_visible()
    editor.page.get_by_role("radio", name="its left side").nth(1).check()
    assert editor.views == [{"box": BOXES[1], "label": "left"}]
    editor.tap(170, 100)
    assert editor.page.locator("#fit_error").inner_text() == ""
    assert "mannequin" not in editor.page.locator("#help_cameras").inner_text()


def test_paints_are_merged_split_dropped_kept_and_named(editor: Editor) -> None:
    editor.mode("Palette")
    editor.choose(*HEXES[:2])
    editor.click("Merge")
    assert editor.palette == {"merge": [list(HEXES[:2])]}
    editor.click("Take back")
    assert editor.palette == {}
    editor.choose(HEXES[1])
    editor.click("Drop")
    editor.click("Keep")
    assert editor.palette == {"keep": [HEXES[2]], "drop": [HEXES[1]]}
    editor.page.get_by_label(f"Name of {HEXES[0]}").fill("coat")
    editor.page.keyboard.press("Tab")
    assert editor.palette["names"] == {HEXES[0]: "coat"}
    editor.choose(HEXES[0])
    editor.click("Split")
    editor.tap(50, 60)
    editor.tap(50, 140)
    assert editor.palette["split"] == [{"color": HEXES[0], "into": list(HEXES[:2])}]
    assert is_valid(editor)


def test_names_are_written_while_the_palette_is_fitted(editor: Editor) -> None:
    editor.mode("Palette")
    editor.page.get_by_label(f"Name of {HEXES[0]}").fill("coat")
    editor.page.keyboard.press("Tab")
    focus = "document.activeElement.getAttribute('aria-label')"
    assert editor.page.evaluate(focus) == f"Choose {HEXES[1]}"
    editor.page.keyboard.press("Tab")
    editor.page.keyboard.type("ca")
    editor.page.evaluate(
        "toonset.model.take({ scene: structuredClone(toonset.model.scene),"
        " corrections: toonset.model.said, busy: false, error: '' })"
    )
    editor.page.keyboard.type("pe")
    editor.page.keyboard.press("Tab")
    assert editor.palette["names"] == {HEXES[0]: "coat", HEXES[1]: "cape"}


def test_a_wrong_label_is_painted_over(editor: Editor) -> None:
    editor.mode("Palette")
    editor.choose(HEXES[1])
    editor.drag((150, 60), (190, 60))
    stroke = editor.palette["strokes"][0]
    assert (stroke["color"], stroke["box"], stroke["radius"]) == (HEXES[1], BOXES[1], 6)
    assert stroke["points"][0] == pytest.approx([150, 60], abs=1)
    assert stroke["points"][-1] == pytest.approx([190, 60], abs=3)
    assert is_valid(editor)


def test_undo_redo_and_a_reload(editor: Editor) -> None:
    editor.card("Leave out", 1)
    editor.card("Leave out", 2)
    editor.click("Undo")
    assert [view["box"] for view in editor.views] == [BOXES[0]]
    editor.page.keyboard.press("Control+y")
    assert len(editor.views) == 2
    editor.page.keyboard.press("Control+z")
    editor.page.reload()
    editor.page.wait_for_selector("#work:not([hidden])")
    assert [view["box"] for view in editor.views] == [BOXES[0]]
    editor.click("Redo")
    assert len(editor.views) == 2
    for _ in range(2):
        editor.click("Undo")
    assert editor.views == []
    assert editor.page.locator("#undo").is_disabled()
    editor.page.get_by_role("radio", name="its left side").first.check()
    editor.page.keyboard.press("Control+z")  # wherever nothing is written
    assert editor.views == []
    editor.page.keyboard.press("Control+y")
    assert editor.views[0]["label"] == "left"


def test_a_file_that_is_newer_than_what_the_browser_kept_counts(editor, open_page):
    editor.card("Leave out", 1)
    newer = open_page({"version": 1, "background": "#ffffff"})
    assert newer.said == {"version": 1, "background": "#ffffff"}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_names_that_mean_harm_on_a_phone(open_page: Open, scheme: str) -> None:
    size = {"width": 360, "height": 740}
    editor = open_page(title=HOSTILE, viewport=size, color_scheme=scheme, locale="he-IL")
    page = editor.page
    page.evaluate("document.documentElement.dir = 'rtl'")
    for mode in ("Figures", "Cameras", "Palette"):
        editor.mode(mode)
        assert page.evaluate("document.documentElement.scrollWidth") == 360, mode
        small = """() => [...document.querySelectorAll("button, select, input:not([hidden])")]
          .filter((one) => one.offsetParent).map((one) => one.getBoundingClientRect())
          .filter((box) => Math.min(box.width, box.height) < 20).length"""
        assert page.evaluate(small) == 0, mode
    assert page.locator("#title").inner_text() == HOSTILE
    assert page.title().startswith("</script>")
    assert page.locator("#cards").is_hidden()  # they are no paints
    editor.mode("Cameras")
    editor.card("Leave out", 1)
    assert editor.download()["sheet"]["name"] == HOSTILE


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (1600, "dark")])
def test_nothing_bars_the_way(open_page, barriers, width, scheme):
    editor = open_page(viewport={"width": width, "height": 740}, color_scheme=scheme)
    editor.mode("Figures")
    assert barriers(editor.page) == []
    editor.mode("Cameras")
    editor.card("Leave out", 1)
    editor.card("Lock", 2)
    assert barriers(editor.page) == []
    editor.mode("Palette")
    editor.choose(HEXES[1])
    editor.click("Drop")
    assert barriers(editor.page) == []


def test_the_page_is_one_file(open_page: Open, tmp_path: Path) -> None:
    open_page()
    text = (tmp_path / "edit.html").read_text(encoding="utf-8")
    assert text.count("<script") == 2
    assert "connect-src" not in text
    assert "http://" not in text.replace("http://www.w3.org", "")
