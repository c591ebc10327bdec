"""What the page keeps in links and files, and what it does with little or hostile data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Page

from tests.apps.web.viewer.conftest import Open
from tests.apps.web.viewer.page_under_test import COLORS, figure_scene

NEW = ((10, 20, 30), (40, 50, 60), (70, 80, 90))


# Links


def test_a_link_holds_what_is_shown(open_page: Open) -> None:
    viewer = open_page()
    assert viewer.page.evaluate("location.hash") == ""
    shown = {
        "yaw": -42.5,
        "elevation": 12.25,
        "zoom": 1.5,
        "pan": [0.125, -0.25],
        "layer": "depth",
        "colors": [list(rgb) for rgb in NEW],
        "ink": [1, 2, 3],
        "cameras": True,
        "lines": False,
    }
    viewer.set(**shown)
    viewer.rest()
    other = open_page(viewer.page.evaluate("location.hash"))
    assert {name: other.state[name] for name in shown} == shown
    assert other.page.locator("#swatches").get_by_label("Lines").input_value() == "#010203"
    assert other.page.get_by_role("radio", name="Depth").is_checked()
    viewer.set(snapped=1, comparison="onion")
    viewer.rest()
    other.page.evaluate("hash => (location.hash = hash)", viewer.page.evaluate("location.hash"))
    other.rest()
    assert (other.state["snapped"], other.state["comparison"]) == (1, "onion")
    assert other.page.locator("#overlay").is_visible()
    other.page.get_by_role("button", name="Copy link").click()
    other.page.wait_for_selector("#message:not(:empty)")


GARBAGE = (
    "#",
    "#%",
    "#%E0%A4%A",
    "#yaw=NaN&elevation=Infinity&zoom=-&pan=1&pan=2",
    "#yaw=1e9&zoom=0x10&pan=a,b&pan=,",
    "#layer=constructor&colors=red,blue,green&ink=zzz&view=99&compare=__proto__",
    "#colors=ff0000&view=9&view=-1&cameras=true",
    "#" + "a=1&" * 20_000,
    "#<img src=x onerror=alert(1)>",
)


def test_garbage_in_a_link_is_passed_over(open_page: Open) -> None:
    viewer = open_page()
    start = viewer.state
    for hash in GARBAGE:
        viewer.page.evaluate("hash => { location.hash = hash; }", hash)
        viewer.page.wait_for_timeout(30)
        assert viewer.state == start, hash[:80]
    far = open_page("#zoom=9999&elevation=-400&pan=99,-99&yaw=725").state
    assert (far["zoom"], far["elevation"], far["pan"], far["yaw"]) == (12, 0, [3, -3], 5)


# Saving


def test_a_picture_is_saved_with_alpha_at_each_size(open_page: Open, tmp_path: Path) -> None:
    viewer = open_page(device_scale_factor=2)
    width = viewer.page.evaluate("document.getElementById('stage').clientWidth")
    for factor in (1, 2, 4):
        viewer.page.locator("#factor").select_option(str(factor))
        with viewer.page.expect_download() as download:
            viewer.page.get_by_role("button", name="Save PNG").click()
        assert download.value.suggested_filename == "A-figure.png"
        download.value.save_as(tmp_path / "a.png")
        with Image.open(tmp_path / "a.png") as picture:
            assert picture.width == factor * width
            assert picture.getpixel((0, 0)) == (0, 0, 0, 0)
            middle = (picture.width // 2, int(picture.height * 0.6))
            assert picture.getpixel(middle) == (*COLORS[0], 255)


def test_a_turning_picture_is_saved(open_page: Open, tmp_path: Path) -> None:
    viewer = open_page()
    with viewer.page.expect_download() as download:
        viewer.page.get_by_role("button", name="Save turntable").click()
    download.value.save_as(tmp_path / "turn")
    with Image.open(tmp_path / "turn") as picture:
        assert (picture.format, picture.size) == ("PNG", (480, 480))
        assert picture.n_frames == 24  # type: ignore[attr-defined]
        frames = []
        for i in range(24):
            picture.seek(i)
            frames.append(picture.convert("RGBA"))
        assert picture.info["loop"] == 0
        assert picture.info["duration"] == 100
    assert frames[0].getpixel((0, 0))[3] == 0  # type: ignore[index]
    spots = [frame.getpixel((240, 240)) for frame in (frames[0], frames[12])]
    for spot, color in zip(spots, (COLORS[1], COLORS[0]), strict=True):  # front and back
        assert spot == pytest.approx([*color, 255], abs=6)
    viewer.rest()
    assert viewer.page.get_by_role("button", name="Save turntable").is_visible()


TITLES = {
    "مرحبا بالعالم": "مرحبا-بالعالم",
    '<b>Bold</b> & "quoted"': "b-Bold-b-quoted",
    "A dragon 🐉": "A-dragon-🐉",
    "...": "figure",
}


@pytest.mark.parametrize("title", TITLES)
def test_a_title_is_shown_and_names_what_is_saved(open_page: Open, title: str) -> None:
    viewer = open_page(scene={"title": title})
    assert viewer.page.locator("h1").inner_text() == title
    assert viewer.page.title() == title
    with viewer.page.expect_download() as download:
        viewer.page.get_by_role("button", name="Save PNG").click()
    assert download.value.suggested_filename == f"{TITLES[title]}.png"


def test_the_embed_code_shows_the_figure_alone(open_page: Open, tmp_path: Path) -> None:
    title = '<b>"me"</b>'
    viewer = open_page(scene={"title": title})
    viewer.set(yaw=90)
    copied = "navigator.clipboard.writeText = async (text) => { globalThis.copied = text; }"
    viewer.page.evaluate(f"() => {{ {copied} }}")
    viewer.page.get_by_role("button", name="Copy embed code").click()
    viewer.until("globalThis.copied")
    code = viewer.page.evaluate("copied")
    (tmp_path / "host.html").write_text(f"<!doctype html><p>host</p>{code}", encoding="utf-8")
    page = viewer.page.context.new_page()
    page.goto((tmp_path / "host.html").as_uri())
    assert page.locator("iframe").get_attribute("title") == title
    frame = page.frame_locator("iframe")
    frame.locator("#poster[hidden]").wait_for(state="attached")
    assert frame.locator("#view").is_visible()
    for other in ("header", ".tools", "#timeline", "#help"):
        assert frame.locator(other).first.is_hidden(), other
    inner = page.frames[1]
    assert inner.evaluate("toonset.store.state.yaw") == 90
    assert inner.evaluate("document.documentElement.scrollHeight") == 600


def test_a_page_that_nobody_may_write_works(open_page: Open, tmp_path: Path) -> None:
    viewer = open_page()
    for place, mode in ((tmp_path / "page.html", 0o444), (tmp_path, 0o555)):
        place.chmod(mode)
    try:
        viewer.page.reload()
        viewer.page.wait_for_selector("#poster[hidden]", state="attached")
        viewer.set(yaw=30)
        viewer.rest()
        assert viewer.page.evaluate("location.hash") == "#yaw=30"
        with viewer.page.expect_download() as download:
            viewer.page.get_by_role("button", name="Save PNG").click()
        assert download.value.path().stat().st_size > 0
    finally:
        tmp_path.chmod(0o755)


# What may go wrong


def test_where_its_data_cannot_be_read_the_first_picture_stays(open_page: Open) -> None:
    viewer = open_page("#yaw=90", scene={"blob": b"no zlib"})
    page = viewer.page
    assert "cannot read" in page.locator("#fallback").inner_text()
    assert page.locator("#poster").is_visible()
    assert page.get_by_role("radio", name="Normals").is_disabled()
    assert page.get_by_label("red").is_disabled()
    for name in ("Save PNG", "Turn", "Lines"):
        assert page.get_by_role("button", name=name, exact=True).is_disabled()
    page.locator("#drawings button").nth(1).click()
    assert "why it is weak" in page.locator("#reason").inner_text()
    page.get_by_role("button", name="Copy hex list").click()
    page.wait_for_selector("#message:not(:empty)")


def test_a_view_that_shows_nothing_is_empty(open_page: Open) -> None:
    sights = figure_scene()[0]["sights"]
    sights[0] = {**sights[0], "layers": {**sights[0]["layers"], "drawn": None}}
    viewer = open_page(scene={"sights": sights})
    assert viewer.pixel(0.5, 0.5) == [0, 0, 0, 0]
    viewer.page.locator("#view").focus()
    viewer.page.keyboard.press("ArrowLeft")
    viewer.rest()
    assert viewer.pixel(0.5, 0.6)[3] == 255


def test_a_scene_with_little_in_it_works(open_page: Open) -> None:
    little = {"views": [], "palette": [], "pen": None, "verdict": None, "layers": ["rgb"]}
    viewer = open_page("#view=1&colors=&ink=ffffff", scene=little)
    for name in ("#timeline", "#paints", "#verdict", "#compare", "#cameras", "#lines"):
        assert viewer.page.locator(name).is_hidden(), name


HOSTILE = (
    "</script><script>globalThis.pwned = 1</script>",
    "\"'><img src=x onerror=globalThis.pwned=1>",
    "\u202eright to left\u2067",
    "\x1b[31mred\x1b[0m",
    "{{script}}",
    "x" * 10_000,
    "long words " * 1000,
)


@pytest.mark.parametrize("title", [HOSTILE[i] for i in (0, 2, 5, 6)], ids=range(4))
def test_hostile_names_are_text(open_page: Open, title: str) -> None:
    scene, _ = figure_scene()
    verdict = {"state": title, "reasons": list(HOSTILE)}
    views = [{**scene["views"][0], "name": text, "reason": text} for text in HOSTILE]
    palette = [{**scene["palette"][0], "name": text} for text in HOSTILE]
    hostile = {"title": title, "verdict": verdict, "views": views, "palette": palette, "pen": None}
    viewer = open_page(scene=hostile, viewport={"width": 360, "height": 800})
    page = viewer.page
    assert page.locator("h1").text_content() == title
    for names in ("#swatches .name", "#drawings .name", "#verdict li"):
        assert page.locator(names).all_text_contents() == list(HOSTILE)
    for i, text in enumerate(HOSTILE):
        page.locator("#drawings button").nth(i).click()
        assert page.locator("#reason bdi").text_content() == text
        assert len(viewer.drop(f"{text}.hex", b"no")) < 200
    assert page.evaluate("globalThis.pwned") is None
    assert page.locator("img, script").count() == 4  # the poster and the page's own
    for width in (360, 800):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") == width
    heights = "[...document.querySelectorAll('h1, li, button, #reason')].map(e => e.clientHeight)"
    assert max(page.evaluate(heights)) < 200


def test_a_small_page_can_be_touched_and_reads_from_right_to_left_too(open_page: Open) -> None:
    viewer = open_page("#view=1&compare=onion", viewport={"width": 360, "height": 740})
    small = """[...document.querySelectorAll("button, select, input, [role=slider]")]
      .map((e) => [e.id || e.name || e.textContent, e.getBoundingClientRect()])
      .filter(([, box]) => box.width && Math.min(box.width, box.height) < 24)
      .map(([name]) => name)"""
    assert viewer.page.evaluate(small) == []
    viewer.page.evaluate("document.documentElement.dir = 'rtl'")
    assert viewer.page.evaluate("document.documentElement.scrollWidth") == 360
    title, pegs = (viewer.page.locator(name).bounding_box() for name in ("h1", ".pegs"))
    assert title is not None
    assert pegs is not None
    assert title["x"] < pegs["x"]


STATES = ("", "#cameras=1", "#view=2", "#view=1&compare=onion")


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (1600, "dark")])
def test_nothing_bars_the_way(
    open_page: Open, barriers: Callable[[Page], list[str]], width: int, scheme: str
) -> None:
    viewer = open_page(viewport={"width": width, "height": 740}, color_scheme=scheme)
    for state in STATES:
        viewer.page.evaluate("state => { location.hash = state; }", state)
        viewer.drop("a.hex", b"no")  # a message shows
        assert barriers(viewer.page) == [], state


def test_nothing_bars_the_way_where_data_cannot_be_read(
    open_page: Open, barriers: Callable[[Page], list[str]]
) -> None:
    scene, _ = figure_scene()
    many = {"blob": b"no", "palette": 200 * scene["palette"]}
    viewer = open_page("#view=2", scene=many, viewport={"width": 360, "height": 740})
    viewer.page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject(); }")
    viewer.page.get_by_role("button", name="Copy hex list").click()
    message = viewer.page.locator("#message:not(:empty)")
    message.focus()  # it is so long that it scrolls, by keys, too
    assert "does not let the page copy" in message.inner_text()
    assert barriers(viewer.page) == []
