"""Views as layers: together they are the view, alone every one is its paint."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PIL import Image

from tests.nerf.look.painted import EYE, INK, PALETTE, camera_at, geometry
from toonset.errors import OutputError, PaletteError, UsageError
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.render.layers import FieldView, Rendering
from toonset.nerf.render.open_raster import PaintLayer, check_layered, encode_ora, layered
from toonset.palette.color_names import name_of

SIZE = 120


def rendering(drawn: Drawings | None, yaw: float) -> Rendering:
    """Return a view of the egg whose field knows its shape, and skin everywhere."""
    seen = geometry(camera_at(yaw))
    shares = np.zeros((*seen.alpha.shape, len(PALETTE)))
    shares[..., 0] = seen.alpha
    field = cast(TrainedField, SimpleNamespace(palette=PALETTE, drawings=drawn))

    rgb = 0.5 * np.repeat(seen.alpha[..., None], 3, axis=-1)
    shown = FieldView(rgb, seen.alpha, seen.depth, None, shares)
    return Rendering(seen.camera, field, lambda: shown, lambda: seen)


def of(view: Rendering, layer: str = "drawn") -> tuple[list[PaintLayer], np.ndarray]:
    picture = view.picture(layer)
    return layered(view, layer, picture), picture


def whole(layer: PaintLayer) -> np.ndarray:
    """Return a layer as large as its view, premultiplied, in [0, 1]."""
    (x, y), (height, width) = layer.place, layer.rgba.shape[:2]
    found = np.zeros((SIZE, SIZE, 4))
    found[y : y + height, x : x + width] = layer.rgba / 255
    found[..., :3] *= found[..., 3:]
    return found


def together(layers: list[PaintLayer]) -> np.ndarray:
    shown = np.zeros((SIZE, SIZE, 4))
    for layer in reversed(layers):
        over = whole(layer)
        shown = over + (1 - over[..., 3:]) * shown
    return shown


def psnr(shown: np.ndarray, picture: np.ndarray) -> float:
    """Return how near premultiplied colours are to a picture, both over white."""
    wanted = picture / 255
    white = wanted[..., :3] * wanted[..., 3:] + 1 - wanted[..., 3:]
    off = shown[..., :3] + 1 - shown[..., 3:] - white
    return float(-10 * np.log10(np.square(off).mean() + 1e-12))


@pytest.mark.parametrize("degrees", [0, 13, 22.5, 180, 200])  # 0 and 180 are drawn ones
def test_layers_together_are_the_view(egg: Drawings, degrees: float) -> None:
    layers, picture = of(rendering(egg, np.radians(degrees)))
    shown = together(layers)
    assert psnr(shown, picture) > 60
    assert np.abs(255 * shown[..., 3] - picture[..., 3]).max() < 1


def test_every_layer_has_its_paint_and_its_name(egg: Drawings) -> None:
    for yaw, names in ((0.0, ["red", "blue", "peach"]), (np.pi, ["green", "red", "peach"])):
        layers, _ = of(rendering(egg, yaw))
        assert [one.name for one in layers] == ["lines", *names]
        lines, *paints = layers
        assert lines.name == "lines"
        assert (np.abs(lines.rgba[lines.rgba[..., 3] > 0][:, :3].astype(int) - INK) <= 1).all()
        for layer in paints:
            solid = layer.rgba[layer.rgba[..., 3] > 250][:, :3].astype(int)
            off = np.abs(solid[:, None] - PALETTE.astype(int)).max(axis=-1)
            assert (off.min(axis=1) <= 30).mean() > 0.97
            own = np.bincount(off.argmin(axis=1)) / len(off)
            assert own.max() > 0.99
            assert name_of(tuple(PALETTE[own.argmax()].tolist())) == layer.name


def test_paint_goes_on_under_the_lines(egg: Drawings) -> None:
    view = rendering(egg, 0.3)
    layers, picture = of(view)
    lines, bare = whole(layers[0])[..., 3], together(layers[1:])
    assert np.abs(lines - view.drawn.ink).max() < 0.02
    hidden = (lines > 0.98) & (picture[..., 3] == 255)
    assert hidden.sum() > 50
    assert (bare[hidden][:, 3] == 1).all()
    off = np.abs(bare[hidden][:, :3] - np.array(INK) / 255).max(axis=-1)
    assert off.min() > 0.2  # no ink there


def test_soft_edges_are_alpha_not_colours_of_their_own(egg: Drawings) -> None:
    layers, _ = of(rendering(egg, 0.0))
    eyes = next(one for one in layers if one.name == name_of(EYE))
    seen = eyes.rgba[eyes.rgba[..., 3] > 0]
    assert (seen[:, 3] < 250).sum() > 20
    assert (np.abs(seen[:, :3].astype(int) - EYE).max(axis=1) <= 25).mean() > 0.97


def test_what_is_seen_of_the_field_has_layers_too(egg: Drawings) -> None:
    for layer in ("rgb", "palette"):
        layers, picture = of(rendering(None, 0.3), layer)
        assert [one.name for one in layers] == ["peach"]
        assert psnr(together(layers), picture) > 60


def test_a_run_without_palette_has_none(egg: Drawings) -> None:
    view = rendering(egg, 0.0)
    bare = replace(view.seen, shares=None)
    view = replace(view, cast=lambda: bare)
    with pytest.raises(PaletteError, match="train again"):
        layered(view, "drawn", view.picture("drawn"))


@pytest.mark.parametrize("layer", ["depth", "labels", "ink", "normal"])
def test_what_has_no_paints_is_refused(layer: str) -> None:
    with pytest.raises(UsageError, match="one of drawn, rgb, palette"):
        check_layered(layer)


def test_the_file_is_as_openraster_says(egg: Drawings) -> None:
    views = [of(rendering(egg, yaw)) for yaw in (0.0, 0.4, 0.8)]
    named = [("front", views[0][0]), ("a <&> b", views[1][0]), ("002", views[2][0])]
    large = [np.tile(picture, (3, 4, 1)) for _, picture in views]
    data = encode_ora(named, large)
    assert data == encode_ora(named, large)
    assert data[30:38] == b"mimetype"
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        assert file.testzip() is None
        assert file.infolist()[0].compress_type == zipfile.ZIP_STORED
        assert file.read("mimetype") == b"image/openraster"
        root = ET.fromstring(file.read("stack.xml"))
        assert (root.get("w"), root.get("h")) == ("480", "360")
        [stack] = root
        assert [group.get("name") for group in stack] == ["front", "a <&> b", "002"]
        assert [group.get("visibility") for group in stack] == ["visible", "hidden", "hidden"]
        sources = [cast(str, layer.get("src")) for layer in stack.iter("layer")]
        assert {name for name in file.namelist() if name.startswith("data/")} == set(sources)
        assert len(set(sources)) == len(sources) == sum(len(layers) for _, layers in named)

        def opened(name: str) -> Any:
            return Image.open(io.BytesIO(file.read(name)))

        np.testing.assert_array_equal(np.array(opened("mergedimage.png")), large[0])
        thumbnail = opened("Thumbnails/thumbnail.png")
        assert (thumbnail.size, thumbnail.mode) == ((256, 192), "RGBA")
    with pytest.raises(OutputError, match="2 sizes"):
        encode_ora(named, [*large, large[0][:-1]])
