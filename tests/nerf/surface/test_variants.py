"""One GLB in several palettes: KHR_materials_variants as Khronos' extension says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.nerf.look.painted import AXES, PALETTE, paint_of
from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.mesh.gltf_file import GltfFile, open_gltf
from toonset.errors import OutputError
from toonset.nerf.look.drawings import Drawings
from toonset.nerf.surface.files import Surface, Variant, palette_texture
from toonset.nerf.surface.texture import painted

DUSK = np.array([(90, 60, 120), (250, 220, 90), (20, 120, 130), (30, 30, 60)], dtype=np.uint8)
VARIANTS = (Variant("dusk", DUSK), Variant("as it is", PALETTE))


@pytest.fixture(scope="module")
def shell() -> Surface:
    ball = trimesh.creation.icosphere(subdivisions=3)
    vertices, faces = np.asarray(ball.vertices) * AXES, np.asarray(ball.faces)
    labels = paint_of(vertices[faces].mean(axis=1))
    return Surface(vertices, faces, labels, PALETTE, VARIANTS)


def read(path: Path) -> GltfFile:
    return open_gltf(path.read_bytes(), path, 10**6)


def materials(file: GltfFile, primitive: dict[str, Any]) -> list[int]:
    """Return a primitive's material per variant; each may be named once, and all must be."""
    count = len(file.json["extensions"]["KHR_materials_variants"]["variants"])
    found: dict[int, int] = {}
    for mapping in primitive["extensions"]["KHR_materials_variants"]["mappings"]:
        for variant in mapping["variants"]:
            assert variant not in found
            found[variant] = mapping["material"]
    assert sorted(found) == list(range(count))
    return [found[variant] for variant in range(count)]


def pictures(file: GltfFile) -> list[np.ndarray]:
    """Return every picture; no two are the same."""
    found = []
    for image in file.json["images"]:
        view = file.json["bufferViews"][image["bufferView"]]
        start = view["byteOffset"]
        found.append(file.buffers[0][start : start + view["byteLength"]])
    assert len(set(found)) == len(found)
    return [decode_rgba(data, Path("image.png"))[..., :3] for data in found]


def shown(file: GltfFile, material: int) -> np.ndarray:
    look = file.json["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"]
    return pictures(file)[file.json["textures"][look["index"]]["source"]]


def primitives(file: GltfFile) -> Sequence[dict[str, Any]]:
    return [primitive for mesh in file.json["meshes"] for primitive in mesh["primitives"]]


def test_a_palette_per_variant(shell: Surface, tmp_path: Path) -> None:
    shell.save(tmp_path / "egg.glb")
    file = read(tmp_path / "egg.glb")
    assert file.json["extensionsUsed"] == ["KHR_materials_unlit", "KHR_materials_variants"]
    assert "extensionsRequired" not in file.json  # viewers without it show the first
    variants = file.json["extensions"]["KHR_materials_variants"]["variants"]
    assert [one["name"] for one in variants] == ["original", "dusk", "as it is"]
    assert variants[1]["extras"]["palette"][0] == "#5a3c78"
    [primitive] = primitives(file)
    own, dusk, again = materials(file, primitive)
    assert own == again == primitive["material"] != dusk  # equal palettes share a picture
    np.testing.assert_array_equal(shown(file, own), palette_texture(PALETTE))
    np.testing.assert_array_equal(shown(file, dusk), palette_texture(DUSK))
    found = trimesh.load(tmp_path / "egg.glb", force="mesh")
    assert isinstance(found, trimesh.Trimesh)
    assert len(found.faces) == len(shell.faces)
    visual: Any = found.visual
    assert visual.material.name == "palette"


def test_a_painted_picture_per_variant(shell: Surface, egg: Drawings, tmp_path: Path) -> None:
    others = [replace(egg, repaint=palette) for palette in (DUSK, PALETTE)]
    textured = painted(shell, egg, outline=True, others=others)
    textured.save(tmp_path / "egg.glb")
    file = read(tmp_path / "egg.glb")
    figure, outline = primitives(file)
    own, dusk, again = materials(file, figure)
    assert own == again != dusk
    assert set(materials(file, outline)) == {outline["material"]}  # drawn lines stay
    assert [file.json["materials"][i]["name"] for i in (own, dusk)] == ["drawn", "drawn dusk"]
    assert len(pictures(file)) == 2
    as_it_is, other = (shown(file, one).astype(int) for one in (own, dusk))
    for old, new in zip(PALETTE.astype(int), DUSK.astype(int), strict=True):
        plain = np.abs(as_it_is - old).max(axis=-1) <= 4
        assert plain.sum() > 30
        assert (np.abs(other - new).max(axis=-1)[plain] <= 12).mean() > 0.95


def test_colours_and_choice_are_those_of_the_recoloured_run(shell: Surface, egg: Drawings) -> None:
    dusk = replace(egg, repaint=DUSK)
    variants = replace(shell, variants=VARIANTS[:1])
    found = painted(variants, egg, others=[dusk])
    alone = painted(replace(shell, palette=DUSK, variants=()), dusk)
    apart = np.abs(found.others[0].astype(int) - alone.picture)
    assert (apart.max(axis=-1) <= 2).mean() > 0.97  # lines may be told a little otherwise in them


def test_without_variants_nothing_is_said_of_them(shell: Surface, tmp_path: Path) -> None:
    replace(shell, variants=()).save(tmp_path / "egg.glb")
    file = read(tmp_path / "egg.glb")
    assert "extensions" not in file.json
    assert file.json["extensionsUsed"] == ["KHR_materials_unlit"]
    assert "extensions" not in primitives(file)[0]


@pytest.mark.parametrize("name", ["egg.obj", "egg.ply"])
def test_only_glb_holds_variants(shell: Surface, egg: Drawings, tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"holds no variants; end -o in \.glb"):
        shell.save(tmp_path / name)
    textured = painted(shell, egg, others=[egg, egg])
    with pytest.raises(OutputError, match=r"holds no variants; end -o in \.glb"):
        textured.save(tmp_path / name)
    assert not list(tmp_path.iterdir())
