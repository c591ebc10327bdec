// The field's own layers: what its rays see, as pictures. The rules are those of nerf/render.

import { CAMERA } from "./field.js";

export const NOWHERE = "-1e9"; // depth where nothing is seen
export const MOST_PAINTS = 32; // as in scene.py, which refuses more

// Label of a colour, and what is the same for all that read rays: one ray through a pixel's middle,
// four more through pixels that differ from a neighbour.
export const RAYS = `
uniform sampler2D rays, ray_depths, fine, fine_depths; // one per pixel, four per pixel
uniform sampler3D table;
uniform bool still, labelled;

int label_of(vec4 seen) {
  if (seen.a <= 0.0) return -1;
  ivec3 level = ivec3(clamp(floor(seen.rgb / max(seen.a, 0.05) * 64.0), 0.0, 63.0));
  return int(round(texelFetch(table, level.bgr, 0).r * 255.0));
}
vec4 ray(ivec2 at) {
  return texelFetch(rays, clamp(at, ivec2(0), textureSize(rays, 0) - 1), 0);
}
bool is_border(ivec2 at) {
  vec4 low = ray(at), high = low;
  int first = labelled ? label_of(low) : 0;
  bool differ = false;
  for (int i = 0; i < 4; i++) {
    vec4 other = ray(at + ivec2(i < 2 ? 2 * i - 1 : 0, i < 2 ? 0 : 2 * i - 5));
    low = min(low, other);
    high = max(high, other);
    differ = differ || (labelled && label_of(other) != first);
  }
  return differ || any(greaterThan(high - low, vec4(0.15)));
}
`;

/** What every pixel shows: premultiplied colour and opacity; depth; label. */
export const SEEN = `${RAYS}
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;
layout(location = 2) out vec4 label; // of 255; 1 = none; whether the pixel is a border
layout(location = 3) out vec4 four; // labels of its rays

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  color = ray(at);
  float away = texelFetch(ray_depths, at, 0).r * color.a;
  int own = labelled ? label_of(color) : -1;
  float name = own < 0 ? 1.0 : float(own) / 255.0;
  bool border = still && is_border(at);
  vec4 names = vec4(name);
  if (border) {
    color = vec4(0.0);
    away = 0.0;
    for (int i = 0; i < 4; i++) {
      ivec2 place = 2 * at + ivec2(i & 1, i >> 1);
      vec4 one = texelFetch(fine, place, 0);
      color += 0.25 * one;
      away += 0.25 * one.a * texelFetch(fine_depths, place, 0).r;
      if (labelled) names[i] = float(max(label_of(one), 0)) / 255.0;
    }
  }
  four = names;
  depth = color.a >= 0.5 ? away / color.a : ${NOWHERE};
  label = vec4(name, float(border), 0.0, 1.0);
}`;

/** Palette colours: every pixel's own, borders unmixed into what they are mixed of. */
export const PALETTE = `${RAYS}
uniform sampler2D seen, labels, fours;
uniform int count;
uniform vec3 paints[${MOST_PAINTS}]; // what the field shows for each label; < 0: nowhere
uniform vec3 shown[${MOST_PAINTS}];
uniform bool indexed;
layout(location = 0) out vec4 result;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(labels, 0) - 1;
  vec4 here = texelFetch(labels, at, 0);
  int own = int(round(here.r * 255.0));
  float alpha = texelFetch(seen, at, 0).a;
  float shares[${MOST_PAINTS}];
  for (int i = 0; i < ${MOST_PAINTS}; i++) shares[i] = 0.0;
  if (here.g < 0.5) {
    if (own < 255) shares[own] = alpha;
  } else {
    for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
      ivec2 place = clamp(at + ivec2(x, y), ivec2(0), most);
      ivec4 others = ivec4(round(texelFetch(fours, place, 0) * 255.0));
      float weight = 0.25 * texelFetch(seen, place, 0).a;
      for (int i = 0; i < 4; i++) if (others[i] < 255) shares[others[i]] += weight;
    }
    ivec3 paint_of = ivec3(0);
    vec3 often = vec3(-1.0);
    for (int i = 0; i < count; i++) {
      float n = shares[i];
      if (n > often.x) { paint_of = ivec3(i, paint_of.xy); often = vec3(n, often.xy); }
      else if (n > often.y) { paint_of = ivec3(paint_of.x, i, paint_of.y); often = vec3(often.x, n, often.y); }
      else if (n > often.z) { paint_of.z = i; often.z = n; }
    }
    for (int i = 0; i < ${MOST_PAINTS}; i++) shares[i] = 0.0;
    for (int i = 0; i < 4; i++) {
      vec4 one = texelFetch(fine, 2 * at + ivec2(i & 1, i >> 1), 0);
      if (one.a <= 0.0) continue;
      vec3 straight = one.rgb / max(one.a, 0.05);
      int first = max(label_of(one), 0), second = first;
      float part = 0.0;
      vec3 off = straight - paints[first];
      float least = paints[first].r < 0.0 ? 1e9 : dot(off, off);
      for (int pair = 0; pair < 3; pair++) {
        int j = pair == 0 ? 0 : pair == 1 ? 0 : 1, k = pair == 0 ? 1 : 2;
        if (often[k] < 0.5 || k >= count || paints[paint_of[j]].r < 0.0 || paints[paint_of[k]].r < 0.0) continue;
        vec3 from = paints[paint_of[j]], way = paints[paint_of[k]] - from;
        float t = clamp(dot(straight - from, way) / max(dot(way, way), 1e-6), 0.0, 1.0);
        off = straight - from - t * way;
        if (dot(off, off) < least) {
          least = dot(off, off);
          first = paint_of[j];
          second = paint_of[k];
          part = clamp((t - 0.5) * 2.0 + 0.5, 0.0, 1.0);
        }
      }
      shares[first] += 0.25 * one.a * (1.0 - part);
      shares[second] += 0.25 * one.a * part;
    }
  }
  vec3 sum = vec3(0.0);
  int best = 0;
  for (int i = 0; i < count; i++) {
    sum += shares[i] * shown[i];
    if (shares[i] > shares[best]) best = i;
  }
  result = indexed ? (alpha >= 0.5 ? vec4(shown[best], 1.0) : vec4(0.0)) : vec4(sum, alpha);
}`;

/** Normals of the world, as red, green, blue. */
export const NORMAL = `${CAMERA}
uniform Camera camera;
uniform sampler2D seen, depths;
layout(location = 0) out vec4 result;

vec3 nearer(ivec2 at, ivec2 way, vec3 here, float depth) {
  ivec2 most = textureSize(depths, 0) - 1;
  vec3 found = vec3(0.0);
  float least = 1e8;
  for (int side = 1; side >= -1; side -= 2) {
    ivec2 place = at + side * way;
    if (any(lessThan(place, ivec2(0))) || any(greaterThan(place, most))) continue;
    float other = texelFetch(depths, place, 0).r;
    if (other <= ${NOWHERE} || abs(other - depth) >= least) continue;
    least = abs(other - depth);
    found = float(side) * (point_at(camera, vec2(place) + 0.5, other) - here);
  }
  return found;
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float depth = texelFetch(depths, at, 0).r;
  result = vec4(0.0);
  if (depth <= ${NOWHERE}) return;
  vec3 here = point_at(camera, vec2(at) + 0.5, depth);
  vec3 normal = cross(nearer(at, ivec2(0, 1), here, depth), nearer(at, ivec2(1, 0), here, depth));
  float size = length(normal);
  if (size == 0.0) return;
  float alpha = texelFetch(seen, at, 0).a;
  result = vec4((normal / size * 0.5 + 0.5) * alpha, alpha);
}`;

/** Depth as grey, the nearest that the hull may be white. */
export const DEPTH = `
uniform sampler2D seen, depths;
uniform vec2 range;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float depth = texelFetch(depths, at, 0).r;
  result = depth <= ${NOWHERE} ? vec4(0.0) : vec4(vec3(1.0 - (depth - range.x) / (range.y - range.x)), 1.0);
}`;

/** A picture as it is. */
export const COPY = `
uniform sampler2D picture;
layout(location = 0) out vec4 result;
void main() { result = texelFetch(picture, ivec2(gl_FragCoord.xy), 0); }`;

/** A picture to the canvas, whose first row is at the bottom. */
export const PRESENT = `
uniform sampler2D picture;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), size = textureSize(picture, 0);
  result = texelFetch(picture, ivec2(at.x, size.y - 1 - at.y), 0);
}`;

/**
 * @param {number[][]} colors 0 to 255
 * @returns {number[]} of a uniform array
 */
export function padded(colors) {
  const flat = colors.slice(0, MOST_PAINTS).flat();
  return Array.from({ length: 3 * MOST_PAINTS }, (_, i) => (flat[i] ?? 0) / 255);
}
