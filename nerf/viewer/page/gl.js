// WebGL2, as little of it as the pictures need: programs, textures, targets, one triangle.

/** @typedef {WebGL2RenderingContext} GL */
/** @typedef {{texture: WebGLTexture, kind: number}} Texture */
/** @typedef {{frame: WebGLFramebuffer, textures: Texture[], width: number, height: number}} Target */
/** @typedef {number | boolean | number[] | Float32Array | Texture} Value of a uniform */

const SAMPLERS = [0x8b5e, 0x8dc1, 0x8b5f]; // SAMPLER_2D, SAMPLER_2D_ARRAY, SAMPLER_3D
const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp sampler3D;
`;

const WHOLE = `void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

/** Programs that fill a target pixel by pixel, and drawings of triangles. */
export class Program {
  /**
   * @param {GL} gl
   * @param {string} fragment source, without version and precision
   * @param {string} [vertex] source; without it one triangle covers everything
   * @param {string[]} [kept] outputs of the vertex shader that are written to a buffer
   */
  constructor(gl, fragment, vertex = WHOLE, kept = []) {
    this.gl = gl;
    this.program = gl.createProgram();
    const shaders = [
      [gl.VERTEX_SHADER, vertex],
      [gl.FRAGMENT_SHADER, fragment],
    ];
    for (const [kind, source] of /** @type {[number, string][]} */ (shaders)) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, HEAD + source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    if (kept.length) gl.transformFeedbackVaryings(this.program, kept, gl.SEPARATE_ATTRIBS);
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`program: ${gl.getProgramInfoLog(this.program)}`);
    }
    /** @type {Map<string, {place: WebGLUniformLocation, type: number, unit: number}>} */
    this.uniforms = new Map();
    let unit = 0;
    const count = gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS);
    for (let i = 0; i < count; i++) {
      const info = /** @type {WebGLActiveInfo} */ (gl.getActiveUniform(this.program, i));
      const place = /** @type {WebGLUniformLocation} */ (gl.getUniformLocation(this.program, info.name));
      const sampled = SAMPLERS.includes(info.type);
      this.uniforms.set(info.name.replace(/\[0\]$/, ""), { place, type: info.type, unit: sampled ? unit++ : -1 });
    }
  }

  /**
   * Set uniforms; names that the shader does not use are passed over.
   * @param {Record<string, Value>} values
   */
  use(values) {
    const gl = this.gl;
    gl.useProgram(this.program);
    for (const [name, value] of Object.entries(values)) {
      const found = this.uniforms.get(name);
      if (!found) continue;
      const { place, type, unit } = found;
      if (unit >= 0) {
        const { texture, kind } = /** @type {Texture} */ (value);
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(kind, texture);
        gl.uniform1i(place, unit);
      } else {
        setUniform(gl, place, type, /** @type {number | boolean | number[]} */ (value));
      }
    }
    return this;
  }

  /** Fill the target that is bound. */
  fill() {
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }
}

/**
 * @param {GL} gl
 * @param {WebGLUniformLocation} place
 * @param {number} type
 * @param {number | boolean | number[]} value
 */
function setUniform(gl, place, type, value) {
  const list = typeof value === "object" ? value : [Number(value)];
  if (type === gl.FLOAT) gl.uniform1fv(place, list);
  else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, list);
  else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, list);
  else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, list);
  else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(place, true, list);
  else if (type === gl.INT_VEC2) gl.uniform2iv(place, list);
  else if (type === gl.INT_VEC3) gl.uniform3iv(place, list);
  else gl.uniform1iv(place, list);
}

/**
 * @param {GL} gl
 * @param {number} kind TEXTURE_2D, TEXTURE_2D_ARRAY or TEXTURE_3D
 * @param {number} format internal, sized
 * @param {number[]} size width, height and, if there are any, layers
 * @param {ArrayBufferView | null} data
 * @param {boolean} smooth whether it is interpolated
 * @returns {Texture}
 */
export function makeTexture(gl, kind, format, size, data, smooth) {
  const texture = gl.createTexture();
  const [layout, type] = formatOf(gl, format);
  gl.bindTexture(kind, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const [width, height, depth] = size;
  if (kind === gl.TEXTURE_2D) {
    gl.texStorage2D(kind, 1, format, width, height);
    if (data) gl.texSubImage2D(kind, 0, 0, 0, width, height, layout, type, data);
  } else {
    gl.texStorage3D(kind, 1, format, width, height, depth);
    if (data) gl.texSubImage3D(kind, 0, 0, 0, 0, width, height, depth, layout, type, data);
    gl.texParameteri(kind, gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE);
  }
  gl.texParameteri(kind, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(kind, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, smooth ? gl.LINEAR : gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, smooth ? gl.LINEAR : gl.NEAREST);
  return { texture, kind };
}

/**
 * @param {GL} gl
 * @param {number} format
 * @returns {[number, number]}
 */
function formatOf(gl, format) {
  if (format === gl.R8) return [gl.RED, gl.UNSIGNED_BYTE];
  if (format === gl.RGBA8) return [gl.RGBA, gl.UNSIGNED_BYTE];
  if (format === gl.R32F) return [gl.RED, gl.FLOAT];
  if (format === gl.RG16F) return [gl.RG, gl.HALF_FLOAT];
  if (format === gl.RGBA32F) return [gl.RGBA, gl.FLOAT];
  if (format === gl.RG32F) return [gl.RG, gl.FLOAT];
  return [gl.RGBA, gl.HALF_FLOAT]; // RGBA16F
}

/**
 * @param {GL} gl
 * @param {number} width
 * @param {number} height
 * @param {number[]} formats of its textures
 * @param {boolean} [solid] whether nearer triangles hide others
 * @param {boolean} [smooth] whether it is interpolated when it is read; 32-bit floats never are, as not
 *   every device can
 * @returns {Target}
 */
export function makeTarget(gl, width, height, formats, solid = false, smooth = false) {
  const frame = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
  const textures = formats.map((format, i) => {
    const made = makeTexture(gl, gl.TEXTURE_2D, format, [width, height], null, smooth && format !== gl.R32F);
    const place = gl.COLOR_ATTACHMENT0 + i;
    gl.framebufferTexture2D(gl.FRAMEBUFFER, place, gl.TEXTURE_2D, made.texture, 0);
    return made;
  });
  gl.drawBuffers(formats.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  if (solid) {
    const depth = gl.createRenderbuffer();
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
  }
  return { frame, textures, width, height };
}

/**
 * @param {GL} gl
 * @param {Target} target
 */
export function freeTarget(gl, target) {
  for (const { texture } of target.textures) gl.deleteTexture(texture);
  gl.deleteFramebuffer(target.frame);
}

const TEXELS = `
uniform sampler2D picture;
flat out uint texel;
void main() {
  int wide = textureSize(picture, 0).x;
  uvec4 bytes = uvec4(round(texelFetch(picture, ivec2(gl_VertexID % wide, gl_VertexID / wide), 0) * 255.0));
  texel = bytes.r | bytes.g << 8 | bytes.b << 16 | bytes.a << 24;
  gl_Position = vec4(0.0);
}`;

/**
 * Reads pictures back by way of a vertex shader's output: unlike `readPixels` it holds up nothing, and
 * no browser warns of it.
 */
export class PictureReader {
  /** @param {GL} gl */
  constructor(gl) {
    this.gl = gl;
    this.program = new Program(gl, "void main() {}", TEXELS, ["texel"]);
    this.feedback = gl.createTransformFeedback();
  }

  /**
   * @param {Target} target its first texture holds bytes
   * @returns {Promise<Uint8ClampedArray<ArrayBuffer>>} RGBA, the first row first
   */
  async read({ textures, width, height }) {
    const { gl } = this;
    const bytes = new Uint8ClampedArray(width * height * 4);
    const buffer = gl.createBuffer();
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, buffer);
    gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, bytes.length, gl.STREAM_READ);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null); // not the one that holds the picture
    gl.enable(gl.RASTERIZER_DISCARD);
    this.program.use({ picture: textures[0] });
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, width * height);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    const fence = /** @type {WebGLSync} */ (gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0));
    gl.flush();
    while (gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) await new Promise((later) => setTimeout(later, 2));
    gl.deleteSync(fence);
    gl.bindBuffer(gl.COPY_READ_BUFFER, buffer);
    gl.getBufferSubData(gl.COPY_READ_BUFFER, 0, bytes);
    gl.bindBuffer(gl.COPY_READ_BUFFER, null);
    gl.deleteBuffer(buffer);
    return bytes;
  }
}
