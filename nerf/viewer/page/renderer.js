// Draws a scene: any layer, from any camera.

import { DrawnLook } from "./drawn.js";
import { Field, cameraUniforms } from "./field.js";
import { PictureReader, Program, freeTarget, makeTarget } from "./gl.js";
import { COPY, DEPTH, NORMAL, PALETTE, PRESENT, SEEN, padded } from "./field_layers.js";
import { Shape } from "./shape.js";
import { project } from "./camera.js";

/** @typedef {import("./types.js").Camera} Camera */
/** @typedef {import("./types.js").Scene} Scene */
/** @typedef {import("./types.js").Shot} Shot */
/** @typedef {import("./gl.js").Target} Target */

/**
 * @param {HTMLCanvasElement} canvas that pictures appear in
 * @param {Scene} scene
 * @param {ArrayBuffer} blob its arrays
 * @throws {Error} where WebGL2, or pictures of floats, are missing
 */
export async function createRenderer(canvas, scene, blob) {
  const gl = contextOf(canvas);
  const field = scene.field ? new Field(gl, scene.field, blob) : null;
  const look = field && scene.drawings ? new DrawnLook(gl, scene.drawings, blob) : null;
  const shape = scene.drawings?.shape ? new Shape(gl, scene.drawings, blob) : null;
  const programs = {
    seen: new Program(gl, SEEN),
    palette: new Program(gl, PALETTE),
    normal: new Program(gl, NORMAL),
    depth: new Program(gl, DEPTH),
    copy: new Program(gl, COPY),
    present: new Program(gl, PRESENT),
  };
  field?.read();
  const reader = new PictureReader(gl);
  /** @type {Record<string, Target>} */
  let targets = {};
  let [x, y, width, height] = [0, 0, 0, 0];
  /** @type {ReturnType<DrawnLook["draw"]>} */
  let crumbs = null; // of the last picture
  let pictures = 0;

  /** @param {Target} target */
  function bind(target, finer = 1) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, target.width, target.height);
    gl.enable(gl.SCISSOR_TEST);
    const [left, top] = [Math.floor(finer * x), Math.floor(finer * y)];
    gl.scissor(left, top, Math.ceil(finer * (x + width)) - left, Math.ceil(finer * (y + height)) - top);
  }

  /** @param {number[]} size */
  function sized([wide, high]) {
    if (targets.picture?.width === wide && targets.picture.height === high) return;
    for (const target of Object.values(targets)) freeTarget(gl, target);
    const { RGBA16F, R32F, RGBA8 } = gl;
    targets = {
      rays: makeTarget(gl, wide, high, [RGBA16F, R32F]),
      fine: makeTarget(gl, 2 * wide, 2 * high, [RGBA16F, R32F]),
      half: makeTarget(gl, Math.ceil(wide / 2), Math.ceil(high / 2), [RGBA16F, R32F], false, true),
      seen: makeTarget(gl, wide, high, [RGBA16F, R32F, RGBA8, RGBA8]),
      picture: makeTarget(gl, wide, high, [RGBA8]),
    };
  }

  /**
   * Draw a picture, its first row first in memory.
   * @param {Shot} shot
   * @returns {Target}
   */
  function picture(shot) {
    const { camera, layer, still } = shot;
    crumbs = null;
    pictures++;
    sized(camera.size);
    [x, y, width, height] = [0, 0, ...camera.size];
    bind(targets.picture);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    const box = field ? boxCorners(scene.field.hull) : (shape?.corners() ?? []);
    const corners = box.map((corner) => project(camera, corner));
    [x, y, width, height] = boxOf(corners, camera.size);
    if (!width || !height) return targets.picture;
    if (!field) {
      shape?.body(camera, still, bind, targets.picture);
      return targets.picture;
    }
    if (layer === "drawn" && shape && !still) {
      const { depth, normal } = shape.see(camera, false, bind);
      look?.draw(camera, { textures: [normal, depth], width: camera.size[0] }, bind, targets.picture, shot);
      return targets.picture;
    }
    if (layer === "drawn" && look && !still) {
      bind(targets.half, 0.5);
      field.see(camera, 0.5);
      look.draw(camera, targets.half, bind, targets.picture, shot);
      return targets.picture;
    }
    const tile = still && layer !== "drawn" ? field.approach(camera) : 0;
    bind(targets.rays);
    field.see(camera, 1, tile);
    if (still) {
      bind(targets.fine, 2);
      field.see(camera, 2, tile);
    }
    const rays = {
      rays: targets.rays.textures[0],
      ray_depths: targets.rays.textures[1],
      fine: targets.fine.textures[0],
      fine_depths: targets.fine.textures[1],
      table: field.table ?? field.safe_steps,
      labelled: Boolean(field.table),
      still,
    };
    bind(targets.seen);
    programs.seen.use(rays).fill();
    const [seen, depths, labels, fours] = targets.seen.textures;
    if (layer === "drawn" && look) {
      const lines = shape?.cover(camera, rays, targets.seen, bind, look.lineScale(camera)) ?? null;
      crumbs = look.draw(camera, targets.seen, bind, targets.picture, shot, lines);
      return targets.picture;
    }
    bind(targets.picture);
    if (layer === "palette" || layer === "labels") {
      const paints = scene.field.paints;
      programs.palette
        .use({
          ...rays,
          seen,
          labels,
          fours,
          count: paints.length,
          paints: padded(paints.map((/** @type {number[]} */ one) => one.map((v) => 255 * v))),
          shown: padded(shot.colors),
          indexed: layer === "labels",
        })
        .fill();
    } else if (layer === "normal") {
      programs.normal.use({ ...cameraUniforms(camera), seen, depths }).fill();
    } else if (layer === "depth") {
      const away = corners.map((corner) => corner[2]);
      programs.depth.use({ seen, depths, range: [Math.min(...away), Math.max(...away)] }).fill();
    } else {
      programs.copy.use({ picture: seen }).fill();
    }
    return targets.picture;
  }

  /** @param {Target} made */
  function present(made) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.SCISSOR_TEST);
    gl.viewport(0, 0, made.width, made.height);
    programs.present.use({ picture: made.textures[0] }).fill();
  }

  /**
   * Draw the last picture again without crumbs.
   * @returns {Promise<boolean>} whether it has changed, and no other was drawn meanwhile
   */
  async function withoutCrumbs() {
    const [own, look_for] = [pictures, crumbs];
    const again = look_for && (await look_for());
    if (!again || own !== pictures) return false;
    again();
    return true;
  }

  return {
    /**
     * Show a picture on the canvas, which takes its size.
     * @param {Shot} shot
     */
    draw(shot) {
      const [wide, high] = shot.camera.size;
      if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
      const made = picture(shot);
      present(made);
      withoutCrumbs().then((changed) => changed && present(made));
    },

    /**
     * @param {Shot} shot
     * @returns {Promise<ImageData>} straight alpha
     */
    async read(shot) {
      const made = picture(shot);
      const own = pictures;
      await withoutCrumbs();
      if (own !== pictures) return this.read(shot); // another picture came between
      const bytes = await reader.read(made);
      for (let i = 0; i < bytes.length; i += 4) {
        const alpha = bytes[i + 3];
        for (let c = i; alpha > 0 && alpha < 255 && c < i + 3; c++) bytes[c] = (bytes[c] * 255) / alpha;
      }
      return new ImageData(bytes, made.width, made.height);
    },
  };
}

/**
 * @param {HTMLCanvasElement} canvas
 * @returns {WebGL2RenderingContext} that can draw floats
 */
function contextOf(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: false, premultipliedAlpha: true });
  if (!gl) throw new Error("this browser has no WebGL2");
  if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("this browser cannot draw floats");
  gl.disable(gl.DITHER);
  return gl;
}

/**
 * @param {any} hull
 * @returns {number[][]} corners of the box that holds all samples, world
 */
function boxCorners(hull) {
  return Array.from({ length: 8 }, (_, i) =>
    [0, 1, 2].map((axis) => hull.low[axis] + hull.voxel * hull.box[(i >> axis) & 1][axis]),
  );
}

/**
 * @param {number[][]} points u, v
 * @param {number[]} size
 * @returns {[number, number, number, number]} left, top, width, height: pixels around the points
 */
function boxOf(points, size) {
  const sides = [0, 1].map((axis) => {
    const along = points.map((point) => point[axis]);
    const low = Math.max(0, Math.floor(Math.min(...along)) - 4);
    return [low, Math.max(0, Math.min(size[axis], Math.ceil(Math.max(...along)) + 4) - low)];
  });
  return [sides[0][0], sides[1][0], sides[0][1], sides[1][1]];
}
