// The drawn look: a new view put together from the drawings beside it, its outline drawn anew.
//
// The steps are those of nerf/look/blend.py: every place of the surface is looked up in the drawings
// beside the view; their labels vote; the colour is the mean of those that carry the winner. The
// outline is where smoothed opacity crosses a level; how far inside a pixel lies is found by jump
// flooding (Rong and Tan 2006) from places on it that lie between pixels.

import { CAMERA, cameraUniforms } from "./field.js";
import { crumbsOf } from "./crumbs.js";
import { PictureReader, Program, freeTarget, makeTarget, makeTexture } from "./gl.js";
import { MOST_PAINTS, NOWHERE, padded } from "./field_layers.js";
import { angleBetween } from "./camera.js";
import { arrayOf } from "./scene.js";

/** @typedef {import("./types.js").Camera} Camera */
/** @typedef {import("./gl.js").Target} Target */

const CELL = 4; // pixels of the coarse grid's side
const TAPS = 4; // drawings that a view is made of: two beside it, two that fill gaps

const LOOK_UP = `${CAMERA}
uniform Camera camera, views[${TAPS}];
uniform int layers[${TAPS}];
uniform ivec2 sizes[${TAPS}];
uniform highp sampler2DArray paint, about, whole;
uniform vec2 depth_range;
uniform float edge_steps;
uniform sampler2D depths;
uniform bool still;

float far_in(float byte) {
  float level = round(byte * 255.0);
  return level > 0.0 ? mix(depth_range.x, depth_range.y, (level - 1.0) / 254.0) : -1e8;
}
float far_of(int tap, ivec2 place) { return far_in(texelFetch(about, ivec3(place, layers[tap]), 0).r); }
vec4 smooth_at(highp sampler2DArray from, int tap, vec2 place) {
  vec2 size = vec2(textureSize(from, 0).xy);
  vec2 kept = clamp(place, vec2(0.0), vec2(sizes[tap]) - 1.0);
  return textureLod(from, vec3((kept + 0.5) / size, float(layers[tap])), 0.0);
}
vec4 cubic_weights(float t) { // OpenCV's cubic, a = -0.75
  float s = 1.0 - t;
  vec4 w = vec4(0.0);
  w.x = ((-0.75 * (t + 1.0) + 3.75) * (t + 1.0) - 6.0) * (t + 1.0) + 3.0;
  w.y = (1.25 * t - 2.25) * t * t + 1.0;
  w.z = (1.25 * s - 2.25) * s * s + 1.0;
  w.w = 1.0 - w.x - w.y - w.z;
  return w;
}
vec4 sharp_at(highp sampler2DArray from, int tap, vec2 place) {
  if (!still) return smooth_at(from, tap, place);
  ivec2 first = ivec2(floor(place)) - 1, most = sizes[tap] - 1;
  vec4 across = cubic_weights(fract(place.x)), down = cubic_weights(fract(place.y)), sum = vec4(0.0);
  for (int y = 0; y < 4; y++) for (int x = 0; x < 4; x++) {
    ivec2 at = clamp(first + ivec2(x, y), ivec2(0), most);
    sum += across[x] * down[y] * texelFetch(from, ivec3(at, layers[tap]), 0);
  }
  return clamp(sum, 0.0, 1.0);
}
`;

/** Depth without gaps and without mixtures of near and far. */
const SURFACE = `
uniform sampler2D depths;
uniform float middle;
layout(location = 0) out vec2 result; // depth; whether something is seen

float depth_at(ivec2 at) {
  return texelFetch(depths, clamp(at, ivec2(0), textureSize(depths, 0) - 1), 0).r;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float own = depth_at(at), low = 1e9, high = -1e9, near = middle, away = 1e9;
  for (int y = -1; y <= 1; y++) for (int x = -1; x <= 1; x++) {
    float other = depth_at(at + ivec2(x, y));
    if (other <= ${NOWHERE}) continue;
    low = min(low, other);
    high = max(high, other);
    float off = float(x * x + y * y);
    if (off < away) { away = off; near = other; }
  }
  bool seen = own > ${NOWHERE};
  if (!seen && high < low) {
    for (int y = -3; y <= 3; y++) for (int x = -3; x <= 3; x++) {
      float other = depth_at(at + ivec2(x, y)), off = float(x * x + y * y);
      if (other > ${NOWHERE} && off < away) { away = off; near = other; }
    }
    result = vec2(near, 0.0);
    return;
  }
  float whole = seen ? own : near;
  float nearer = min(whole, 0.5 * (whole + low)), farther = max(whole, 0.5 * (whole + high));
  result = vec2(whole - low < high - whole ? nearer : farther, float(seen));
}`;

/** Where the outline is so near that it matters: the least opacity around, on a coarse grid. */
const COARSE = `
uniform sampler2D rays;
uniform float reach, fine;
layout(location = 0) out vec4 result;
void main() {
  vec2 texel = 1.0 / vec2(textureSize(rays, 0));
  vec2 at = gl_FragCoord.xy * float(CELL) * fine * texel;
  float low = 1.0, high = 0.0;
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
    float alpha = textureLod(rays, at + 0.5 * reach * fine * vec2(x, y) * texel, 0.0).a;
    low = min(low, alpha);
    high = max(high, alpha);
  }
  result = vec4(low, high, 0.0, 1.0);
}`;

/** Colours of a moving figure, for every second pixel: one drawing each, no votes around. */
const COLORS = `${LOOK_UP}
uniform sampler2D rays;
uniform Camera pair;
uniform sampler2D flow;
uniform bool flows;
uniform float slack, sign, share;
uniform float fine; // pixels of the rays per pixel of the view
uniform bool shaped, shaded;
uniform float shade_level;
uniform vec3 shade_slope, shade_factor;
uniform vec3 old_paints[${MOST_PAINTS}], new_paints[${MOST_PAINTS}];
uniform bool changed;
layout(location = 0) out vec4 result;

void main() {
  int block = fine > 0.75 ? 2 : 1;
  ivec2 at = block * ivec2(gl_FragCoord.xy), most = textureSize(depths, 0) - 1;
  result = vec4(0.0);
  // of a block, the first pixel that shows the figure
  for (int i = 1; i < 4 && block == 2 && texelFetch(rays, at, 0).a < 0.5; i++) {
    at = min(2 * ivec2(gl_FragCoord.xy) + ivec2(i & 1, i >> 1), most);
  }
  vec4 ray = texelFetch(rays, at, 0);
  if (ray.a < 0.05) return;
  vec3 point = point_at(camera, (vec2(at) + 0.5) / fine, texelFetch(depths, at, 0).r);
  vec2 apart = vec2(0.0);
  if (flows) {
    vec2 place = seen_by(pair, point).xy;
    apart = sign * textureLod(flow, place / vec2(textureSize(flow, 0)), 0.0).rg;
  }
  vec3 best = vec3(seen_by(views[0], point).xy - 0.5, 0.0); // place and drawing
  float heaviest = 0.0;
  for (int tap = 0; tap < ${TAPS}; tap++) {
    if (layers[tap] < 0 || (tap == 1 && heaviest >= 1.0 - share) || (tap > 1 && heaviest > 0.0)) continue;
    vec3 seen = seen_by(views[tap], point);
    ivec2 cell = ivec2(floor(seen.xy));
    if (any(lessThan(cell, ivec2(0))) || any(greaterThanEqual(cell, sizes[tap]))) continue;
    vec4 known = texelFetch(about, ivec3(cell, layers[tap]), 0);
    if (known.b <= 0.5 || seen.z > far_in(known.r) + slack) continue;
    float edge = known.g * 255.0 / edge_steps / FEATHER_PX;
    float weight = (tap == 0 ? share + LEAD : tap == 1 ? 1.0 - share : 1.0) * (1.0 - 0.9 * exp(-edge * edge));
    if (weight <= heaviest) continue;
    heaviest = weight;
    best = vec3(seen.xy - 0.5 + (tap == 0 ? share - 1.0 : tap == 1 ? share : 0.0) * apart, float(tap));
  }
  int tap = int(best.z);
  vec3 color = clamp(ray.rgb / max(ray.a, 0.2), 0.0, 1.0);
  if (shaped || heaviest > 0.0) color = smooth_at(paint, tap, best.xy).rgb;
  if (changed && heaviest > 0.0) {
    ivec2 cell = clamp(ivec2(round(best.xy)), ivec2(0), sizes[tap] - 1);
    int label = int(round(texelFetch(paint, ivec3(cell, layers[tap]), 0).a * 255.0));
    color = clamp(color + new_paints[label] - old_paints[label], 0.0, 1.0);
  }
  if (shaded && dot(ray.rgb * 2.0 - 1.0, shade_slope) + shade_level > 0.0) color *= shade_factor;
  result = vec4(color, 1.0);
}`;

/** The same look while the figure turns: its colours, and outlines without flooding. */
const FAST = `
uniform sampler2D rays, depths, coarse, colors;
uniform float border, line;
uniform float fine; // pixels of the rays per pixel
uniform vec2 reaches; // of inner lines onto the near and the far side; 0: none
uniform float least_step;
uniform vec3 ink;
layout(location = 0) out vec4 result;

float alpha_at(vec2 pixel) {
  return textureLod(rays, pixel * fine / vec2(textureSize(rays, 0)), 0.0).a;
}
float inner_line(ivec2 at) {
  ivec2 most = textureSize(depths, 0) - 1;
  float own = texelFetch(depths, at, 0).r, line = 0.0;
  for (int i = 0; i < 8; i++) {
    float turn = float(i >> 1) * 0.7854, reach = (i & 1) == 0 ? reaches.x : reaches.y;
    ivec2 way = ivec2(round(max(reach, 1.0) * vec2(cos(turn), sin(turn))));
    vec2 sides = vec2(
      texelFetch(depths, clamp(at + way, ivec2(0), most), 0).r,
      texelFetch(depths, clamp(at - way, ivec2(0), most), 0).r);
    if (min(sides.x, sides.y) <= ${NOWHERE}) continue;
    vec2 off = (i & 1) == 0 ? sides - own : own - sides, step_off = off - abs(off.yx);
    if (max(step_off.x, step_off.y) > least_step) line = max(line, min(reach, 1.0));
  }
  return line;
}
void main() {
  vec2 around = textureLod(coarse, gl_FragCoord.xy / float(CELL) / vec2(textureSize(coarse, 0)), 0.0).rg;
  result = vec4(0.0);
  if (around.g < 0.05) return;
  vec2 pixel = gl_FragCoord.xy;
  float cover = 1.0, stroke = 0.0;
  if (around.r < 0.95) {
    float own = alpha_at(pixel);
    vec2 slope = vec2(
      alpha_at(pixel + vec2(1.0, 0.0)) - alpha_at(pixel - vec2(1.0, 0.0)),
      alpha_at(pixel + vec2(0.0, 1.0)) - alpha_at(pixel - vec2(0.0, 1.0))) * 0.5;
    cover = clamp((own - border) / max(length(slope), 0.05) + 0.5, 0.0, 1.0);
    if (cover <= 0.0) return;
    if (line > 0.0) {
      float least = own;
      for (int i = 0; i < 12; i++) {
        float turn = float(i) * 0.5236;
        least = min(least, alpha_at(pixel + line * vec2(cos(turn), sin(turn))));
      }
      stroke = min(cover, clamp(0.5 + 2.5 * (border - least), 0.0, 1.0));
    }
  }
  vec4 color = textureLod(colors, 0.5 * pixel / vec2(textureSize(colors, 0)), 0.0);
  color.rgb /= max(color.a, 1.0 / 255.0);
  if (reaches.x + reaches.y > 0.0) stroke = max(stroke, min(cover, inner_line(ivec2(pixel * fine))));
  result = vec4(color.rgb * (cover - stroke) + stroke * ink, cover);
}`;

/** Which of the drawings show a place. */
const MASKS = `${LOOK_UP}
uniform float slack;
layout(location = 0) out vec4 result;
void main() {
  vec2 here = texelFetch(depths, ivec2(gl_FragCoord.xy), 0).rg;
  vec4 shown = vec4(0.0);
  result = shown;
  if (here.g < 0.5) return;
  vec3 point = point_at(camera, gl_FragCoord.xy, here.r);
  for (int tap = 0; tap < ${TAPS}; tap++) {
    if (layers[tap] < 0) continue;
    vec3 seen = seen_by(views[tap], point);
    vec2 place = seen.xy - 0.5;
    ivec2 at = ivec2(round(place));
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, sizes[tap]))) continue;
    float covered = smooth_at(about, tap, place).b;
    shown[tap] = float(covered > 0.5 && seen.z <= far_of(tap, at) + slack);
  }
  result = shown;
}`;

/** What the drawings say of every pixel, and how much that counts. */
const CANDIDATES = `${LOOK_UP}
uniform sampler2D masks, field, labels;
uniform Camera pair;
uniform sampler2D flow;
uniform bool flows;
uniform float sign, share, part;
uniform vec3 tones[${MOST_PAINTS}];
uniform int count;
layout(location = 0) out vec4 said;    // labels of three candidates, and the field's, of 255
layout(location = 1) out vec4 weights; // of these
layout(location = 2) out vec4 first;   // colour; whether a drawing shows the pixel
layout(location = 3) out vec4 second;
layout(location = 4) out vec4 third;
layout(location = 5) out vec4 own;     // the nearest drawing itself, premultiplied

vec4 feathered(ivec2 at, vec4 mask) {
  ivec2 most = textureSize(masks, 0) - 1;
  vec4 sum = vec4(0.0);
  float total = 0.0;
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
    float weight = exp(-0.5 * float(x * x + y * y));
    sum += weight * texelFetch(masks, clamp(at + ivec2(x, y), ivec2(0), most), 0);
    total += weight;
  }
  return (clamp(2.0 * sum / total - 1.0, 0.0, 1.0) + 0.02) * mask;
}
float trust(int tap, vec2 place) {
  float edge = smooth_at(about, tap, place).g * 255.0 / edge_steps / FEATHER_PX;
  return 1.0 - 0.9 * exp(-edge * edge);
}
int label_at(int tap, vec2 place) {
  ivec2 at = clamp(ivec2(round(place)), ivec2(0), sizes[tap] - 1);
  return int(round(texelFetch(paint, ivec3(at, layers[tap]), 0).a * 255.0));
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec2 here = texelFetch(depths, at, 0).rg;
  vec3 point = point_at(camera, gl_FragCoord.xy, here.r);
  vec2 places[${TAPS}];
  for (int tap = 0; tap < ${TAPS}; tap++) places[tap] = seen_by(views[tap], point).xy - 0.5;
  own = part > 0.0 ? sharp_at(whole, 0, places[0]) : vec4(0.0);
  if (part > 0.0 && (any(lessThan(places[0], vec2(-0.5))) || any(greaterThan(places[0], vec2(sizes[0]) - 0.5)))) own = vec4(0.0);
  said = weights = first = second = third = vec4(0.0);
  vec4 mask = texelFetch(masks, at, 0);
  if (here.g < 0.5) return;
  vec2 apart = vec2(0.0);
  if (flows) {
    vec2 place = seen_by(pair, point).xy;
    apart = sign * textureLod(flow, place / vec2(textureSize(flow, 0)), 0.0).rg;
  }
  vec4 soft = feathered(at, mask);
  vec2 moved = places[0] - (1.0 - share) * apart;
  first = vec4(sharp_at(paint, 0, moved).rgb, 1.0);
  said.x = float(label_at(0, moved)) / 255.0;
  weights.x = (share + LEAD) * trust(0, moved) * soft.x;
  if (share < 1.0) {
    moved = places[1] + share * apart;
    second = vec4(sharp_at(paint, 1, moved).rgb, 1.0);
    said.y = float(label_at(1, moved)) / 255.0;
    weights.y = (1.0 - share) * trust(1, moved) * soft.y;
  }
  bool covered = mask.x > 0.5 || (mask.y > 0.5 && share < 1.0);
  for (int tap = 2; tap < ${TAPS} && !covered; tap++) {
    if (mask[tap] < 0.5) continue;
    third = vec4(sharp_at(paint, tap, places[tap]).rgb, 1.0);
    said.z = float(label_at(tap, places[tap])) / 255.0;
    weights.z = SIDE_VOTE;
    covered = true;
  }
  vec4 seen = texelFetch(field, at, 0);
  if (!covered) {
    vec3 straight = clamp(seen.rgb / max(seen.a, 0.2), 0.0, 1.0);
    int best = 0;
    float least = 1e9;
    for (int i = 0; i < count; i++) {
      vec3 off = straight - tones[i];
      if (dot(off, off) < least) { least = dot(off, off); best = i; }
    }
    third = vec4(straight, 1.0);
    said.z = float(best) / 255.0;
    weights.z = OWN_VOTE;
  }
  float label = texelFetch(labels, at, 0).r;
  said.w = label;
  weights.w = label < 0.999 ? FIELD_VOTE * seen.a : 0.0;
  first.a = float(covered);
}`;

/** The label that most speaks for around every pixel, and the mean colour of what carries it. */
const VOTE = `
uniform sampler2D said, weights, first, second, third;
layout(location = 0) out vec4 result; // colour, label of 255
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(said, 0) - 1;
  float votes[${MOST_PAINTS}];
  for (int i = 0; i < ${MOST_PAINTS}; i++) votes[i] = 0.0;
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
    ivec2 place = clamp(at + ivec2(x, y), ivec2(0), most);
    vec4 w = exp(-float(x * x + y * y) / 1.28) * texelFetch(weights, place, 0);
    ivec4 l = ivec4(round(texelFetch(said, place, 0) * 255.0));
    if (w.x > 0.0) votes[l.x] += w.x;
    if (w.y > 0.0) votes[l.y] += w.y;
    if (w.z > 0.0) votes[l.z] += w.z;
    if (w.w > 0.0) votes[l.w] += w.w;
  }
  int best = 0;
  for (int i = 1; i < ${MOST_PAINTS}; i++) if (votes[i] > votes[best]) best = i;
  vec3 w = pow(texelFetch(weights, at, 0).rgb, vec3(SHARP));
  ivec3 l = ivec3(round(texelFetch(said, at, 0).rgb * 255.0));
  vec3 kept = w * vec3(equal(l, ivec3(best)));
  if (kept.x + kept.y + kept.z < 1e-4) kept += 1e-4 * w;
  float total = max(kept.x + kept.y + kept.z, 1e-9);
  vec3 color = kept.x * texelFetch(first, at, 0).rgb + kept.y * texelFetch(second, at, 0).rgb + kept.z * texelFetch(third, at, 0).rgb;
  result = vec4(color / total, float(best) / 255.0);
}`;

/**
 * Other colours: see palette/pixels/recolor.py. A pixel is a mixture of two tones that lie around
 * it; what is no shade of any stays.
 */
const RECOLOR = `
uniform sampler2D voted;
uniform int count;
uniform vec3 old_paints[${MOST_PAINTS}], new_paints[${MOST_PAINTS}], shadow;
layout(location = 0) out vec4 result;

vec3 oklab(vec3 c) {
  vec3 x = mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
  vec3 l = mat3(0.4122, 0.2119, 0.0883, 0.5363, 0.6807, 0.2817, 0.0514, 0.1074, 0.6300) * x;
  l = pow(max(l, 0.0), vec3(1.0 / 3.0));
  return mat3(0.2105, 1.9780, 0.0259, 0.7936, -2.4286, 0.7828, -0.0041, 0.4506, -0.8087) * l;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(voted, 0) - 1;
  result = texelFetch(voted, at, 0);
  vec3 c = result.rgb;
  float seen[${MOST_PAINTS}];
  for (int i = 0; i < ${MOST_PAINTS}; i++) seen[i] = 0.0;
  bool moves = false;
  for (int y = -3; y <= 3; y++) for (int x = -3; x <= 3; x++) {
    int label = int(round(texelFetch(voted, clamp(at + ivec2(x, y), ivec2(0), most), 0).a * 255.0));
    seen[label] += max(abs(x), abs(y)) <= 1 ? 4.0 : 1.0;
    moves = moves || new_paints[label] != old_paints[label];
  }
  if (!moves) return;
  vec3 whole = vec3(0.0), change = vec3(0.0);
  float least = 1e9;
  for (int i = 0; i < count; i++) {
    if (seen[i] == 0.0) continue;
    for (int tone = 0; tone < 2; tone++) {
      vec3 a = old_paints[i] * (tone == 0 ? vec3(1.0) : shadow), to = new_paints[i] * (tone == 0 ? vec3(1.0) : shadow);
      for (int j = i; j < count; j++) {
        if (seen[j] == 0.0) continue;
        for (int other = 0; other < 2; other++) {
          vec3 b = old_paints[j] * (other == 0 ? vec3(1.0) : shadow);
          vec3 way = b - a;
          float t = clamp(dot(c - a, way) / max(dot(way, way), 1e-5), 0.0, 1.0);
          vec3 off = c - a - t * way;
          if (dot(off, off) >= least) continue;
          least = dot(off, off);
          whole = a + t * way;
          change = mix(to, new_paints[j] * (other == 0 ? vec3(1.0) : shadow), t) - whole;
        }
      }
    }
  }
  float level = 0.015;
  float shade = clamp(dot(c + level, whole + level) / dot(whole + level, whole + level), 0.0, 1.25);
  vec3 like = clamp(shade * (whole + level) - level, 0.0, 1.0);
  float kept = clamp(2.0 - distance(oklab(c), oklab(like)) / 0.06, 0.0, 1.0);
  result.rgb = clamp(c + kept * shade * change, 0.0, 1.0);
}`;

/** Slivers that no drawing shows go on with the paint beside them, if it is of the same surface. */
const SLIVERS = `
uniform sampler2D voted, first, depths;
uniform float reach, apart;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(voted, 0) - 1;
  result = texelFetch(voted, at, 0);
  vec2 here = texelFetch(depths, at, 0).rg;
  if (here.g < 0.5 || texelFetch(first, at, 0).a > 0.5) return;
  float least = 1e9, stride = max(1.0, reach / 16.0);
  ivec2 best = at;
  for (int y = -16; y <= 16; y++) for (int x = -16; x <= 16; x++) {
    vec2 off = stride * vec2(x, y);
    ivec2 place = at + ivec2(round(off));
    if (any(lessThan(place, ivec2(0))) || any(greaterThan(place, most))) continue;
    if (length(off) >= least || length(off) > reach || texelFetch(first, place, 0).a < 0.5) continue;
    least = length(off);
    best = place;
  }
  if (least < 1e8 && abs(texelFetch(depths, best, 0).r - here.r) <= apart) result = texelFetch(voted, best, 0);
}`;

/** Opacity smoothed, and the nearest place on the outline for pixels beside it. */
const RIM = `
uniform sampler2D field, own, crumbs;
uniform float border, part;
uniform bool crumby;
layout(location = 0) out vec4 result; // place on the outline, in pixels; cover; opacity over the level

float alpha_at(ivec2 at) {
  ivec2 place = clamp(at, ivec2(0), textureSize(field, 0) - 1);
  float alpha = texelFetch(field, place, 0).a;
  if (part > 0.0) alpha = mix(alpha, texelFetch(own, place, 0).a, part);
  float change = crumby ? texelFetch(crumbs, place, 0).r : 0.0;
  return change > 0.75 ? 1.0 : change > 0.25 ? 0.0 : alpha;
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float sum = 0.0, total = 0.0;
  vec2 slope = vec2(0.0);
  for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
    vec2 off = vec2(x, y);
    float weight = exp(-dot(off, off) / (2.0 * SPREAD)), alpha = alpha_at(at + ivec2(x, y));
    sum += weight * alpha;
    slope += weight * alpha * off / SPREAD;
    total += weight;
  }
  float level = sum / total - border;
  slope /= total;
  float size = max(length(slope), 1e-4), inside = level / size;
  bool beside = abs(inside) < 1.0 && length(slope) > 0.02;
  vec2 place = vec2(at) + 0.5 - slope / size * inside;
  result = vec4(beside ? place : vec2(-1e4), clamp(inside + 0.5, 0.0, 1.0), level);
}`;

/** Inside of the outline or not, to be looked at for crumbs. */
const INSIDE = `
uniform sampler2D places;
layout(location = 0) out vec4 result;
void main() { result = vec4(float(texelFetch(places, ivec2(gl_FragCoord.xy), 0).a >= 0.0)); }`;

/** One round of jump flooding. */
const FLOOD = `
uniform sampler2D places;
uniform int reach;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(places, 0) - 1;
  result = texelFetch(places, at, 0);
  float least = distance(result.xy, gl_FragCoord.xy);
  for (int y = -1; y <= 1; y++) for (int x = -1; x <= 1; x++) {
    vec2 other = texelFetch(places, clamp(at + reach * ivec2(x, y), ivec2(0), most), 0).xy;
    float away = distance(other, gl_FragCoord.xy);
    if (away < least) { least = away; result.xy = other; }
  }
}`;

/** Everything over each other. */
const COMPOSE = `
uniform sampler2D places, voted, before, field, own, style; // before: 'voted' in the old colours
uniform float line, part;
uniform vec3 ink;
uniform bool styled;
uniform bool plain; // the drawing's own line is shown, too
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy), most = textureSize(voted, 0) - 1;
  vec4 rim = texelFetch(places, at, 0);
  float cover = rim.z, stroke = 0.0;
  if (line > 0.0) stroke = min(cover, clamp(line + 0.5 - distance(rim.xy, gl_FragCoord.xy), 0.0, 1.0));
  vec3 color = texelFetch(voted, at, 0).rgb;
  if (cover > 0.0 && texelFetch(field, at, 0).a <= 0.5) {
    float least = 1e9;
    for (int y = -8; y <= 8; y++) for (int x = -8; x <= 8; x++) {
      ivec2 place = clamp(at + ivec2(x, y), ivec2(0), most);
      float off = float(x * x + y * y);
      if (off < least && texelFetch(field, place, 0).a > 0.5) { least = off; color = texelFetch(voted, place, 0).rgb; }
    }
  }
  if (styled) {
    vec4 own_style = texelFetch(style, at, 0);
    color *= own_style.rgb;
    if (line > 0.0) stroke = max(stroke, min(own_style.a, cover));
  }
  result = vec4(color * (cover - stroke) + stroke * ink, cover);
  if (part > 0.0 && plain) {
    vec4 drawing = texelFetch(own, at, 0);
    vec3 old = texelFetch(before, at, 0).rgb;
    float like = clamp(1.0 - 2.0 * distance(drawing.rgb / max(drawing.a, 0.01), old), 0.0, 1.0);
    drawing.rgb += like * drawing.a * (texelFetch(voted, at, 0).rgb - old);
    result = mix(result, vec4(min(drawing.rgb, drawing.aaa), drawing.a), part);
  }
}`;

/**
 * The two drawings beside a view, and the first one's share: see `flanking` in nerf/look/blend.py.
 * @param {Camera[]} cameras
 * @param {Camera} camera
 * @param {number} neighbours radians: drawings farther apart show too little in common
 * @returns {[number, number, number]}
 */
export function flanking(cameras, camera, neighbours) {
  const forward = camera.rotation.slice(6);
  const theirs = cameras.map((one) => one.rotation.slice(6));
  const dot = (/** @type {number[]} */ a, /** @type {number[]} */ b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
  const angles = cameras.map((one) => angleBetween(one, camera));
  const first = angles.indexOf(Math.min(...angles));
  const start = theirs[first];
  let [second, least, along, whole] = [first, Infinity, 0, 1];
  theirs.forEach((one, i) => {
    const turn = one.map((v, j) => v - dot(one, start) * start[j]);
    const size = Math.hypot(...turn);
    const angle = Math.atan2(size, dot(one, start));
    const unit = turn.map((v) => v / Math.max(size, 1e-12));
    const towards = Math.atan2(dot(unit, forward), dot(start, forward));
    if (towards > 1e-9 && angle > 1e-9 && angle < neighbours && angles[i] < least) {
      [second, least, along, whole] = [i, angles[i], towards, angle];
    }
  });
  if (second === first) return [first, first, 1];
  return [first, second, 1 - Math.min(1, along / whole)];
}

/** The drawings of a sheet, ready to be put together. */
export class DrawnLook {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {any} record
   * @param {ArrayBuffer} blob
   */
  constructor(gl, record, blob) {
    this.gl = gl;
    this.record = record;
    const layers = (/** @type {any} */ one, /** @type {boolean} */ smooth) => {
      const [count, height, width] = one.shape;
      return makeTexture(gl, gl.TEXTURE_2D_ARRAY, gl.RGBA8, [width, height, count], arrayOf(blob, one), smooth);
    };
    this.paint = layers(record.paint, true);
    this.whole = layers(record.whole, true);
    this.about = layers(record.about, true);
    this.flows = record.flows.map((/** @type {any} */ one) => {
      const [height, width] = one.flow.shape;
      const flow = makeTexture(gl, gl.TEXTURE_2D, gl.RG16F, [width, height], arrayOf(blob, one.flow), true);
      return { pair: one.pair, camera: one.camera, flow };
    });
    const votes = `#define SIDE_VOTE ${record.sideVote}\n#define OWN_VOTE ${record.ownVote}\n#define FIELD_VOTE ${record.fieldVote}\n#define LEAD ${record.lead.toFixed(4)}\n#define SHARP ${record.sharp.toFixed(1)}\n#define FEATHER_PX ${record.featherPx.toFixed(4)}\n`;
    this.none = makeTexture(gl, gl.TEXTURE_2D, gl.RGBA8, [1, 1], null, false);
    this.surface = new Program(gl, SURFACE);
    this.masks = new Program(gl, MASKS);
    this.candidates = new Program(gl, votes + CANDIDATES);
    this.vote = new Program(gl, votes + VOTE);
    this.recolor = new Program(gl, RECOLOR);
    this.inside = new Program(gl, INSIDE);
    this.slivers = new Program(gl, SLIVERS);
    this.reader = new PictureReader(gl);
    this.rim = new Program(gl, `#define SPREAD 0.62\n${RIM}`);
    this.flood = new Program(gl, FLOOD);
    this.compose = new Program(gl, COMPOSE);
    this.coarse = new Program(gl, `#define CELL ${CELL}\n${COARSE}`);
    this.colors = new Program(gl, votes + COLORS);
    this.fast = new Program(gl, `#define CELL ${CELL}\n${FAST}`);
    /** @type {Record<string, Target> | null} */
    this.targets = null;
  }

  /**
   * @param {number} width
   * @param {number} height
   */
  sized(width, height) {
    const { gl } = this;
    if (this.targets && (this.targets.surface.width !== width || this.targets.surface.height !== height)) {
      for (const target of Object.values(this.targets)) freeTarget(gl, target);
      this.targets = null;
    }
    if (this.targets) return this.targets;
    const make = (/** @type {number[]} */ ...formats) => makeTarget(gl, width, height, formats);
    const bytes = gl.RGBA8;
    this.targets = {
      surface: make(gl.RG32F),
      masks: make(bytes),
      candidates: make(bytes, gl.RGBA16F, bytes, bytes, bytes, bytes),
      vote: make(bytes),
      recolor: make(bytes),
      slivers: make(bytes),
      rim: make(gl.RGBA32F),
      flood: make(gl.RGBA32F),
      inside: make(bytes),
      colors: makeTarget(gl, Math.ceil(width / 2), Math.ceil(height / 2), [bytes], false, true),
      coarse: makeTarget(gl, Math.ceil(width / CELL), Math.ceil(height / CELL), [bytes], false, true),
    };
    return this.targets;
  }

  /**
   * @param {Camera} camera
   * @returns {number} pixels of a view per pixel of the drawings, for inner lines; 0: there are none
   */
  lineScale(camera) {
    const { cameras, pen, outline, neighbours } = this.record;
    if (!pen || !outline) return 0;
    const [first] = flanking(cameras, camera, neighbours);
    return (camera.scale / cameras[first].scale) * (pen.width_px / Math.max(outline.width_px, 1e-6));
  }

  /**
   * @param {number} line width of the outline, pixels; 0: there is none
   * @returns {Record<string, any>} what the quick look needs of a shape's style
   */
  styleOf(line) {
    const { shape, shade, steps, outline, height } = this.record;
    const scale = outline ? line / Math.max(outline.width_px, 1e-6) : 0;
    return {
      shaped: Boolean(shape),
      shaded: Boolean(shape && shade),
      shade_slope: shade?.slope ?? [0, 0, 0],
      shade_level: shade?.level ?? 0,
      shade_factor: shade?.factor ?? [1, 1, 1],
      reaches: shape && steps ? [steps.near_px * scale, steps.far_px * scale] : [0, 0],
      least_step: steps ? steps.least * height : 0,
    };
  }

  /**
   * Draw a view into a target.
   * @param {Camera} camera
   * @param {Pick<Target, "textures" | "width">} seen colour, depth and label of the field: see `SEEN`
   * @param {(target: Target, finer?: number) => void} bind
   * @param {Target} into
   * @param {{colors: number[][], ink: number[] | null, still: boolean}} style
   * @param {import("./gl.js").Texture | null} [lines] tone, and lines, of a shape
   * @returns {(() => Promise<(() => void) | null>) | null} looks for crumbs, and returns what draws
   *   the view again without them; null where there are none
   */
  draw(camera, seen, bind, into, style, lines = null) {
    const { record } = this;
    const [field, depths, labels] = seen.textures;
    const targets = this.sized(into.width, into.height);
    const { cameras } = record;
    const [first, second, share] = flanking(cameras, camera, record.neighbours);
    const turns = cameras.map((/** @type {Camera} */ one) => angleBetween(one, camera));
    const others = cameras
      .map((/** @type {Camera} */ _, /** @type {number} */ i) => i)
      .filter((/** @type {number} */ i) => i !== first && i !== second && turns[i] < record.side)
      .sort((/** @type {number} */ a, /** @type {number} */ b) => turns[a] - turns[b]);
    const taps = [first, second, others[0] ?? -1, others[1] ?? -1];
    const eased = Math.max(0, 1 - turns[first] / record.own);
    const part = eased * eased * (3 - 2 * eased);
    const paired = this.flows.find(
      (/** @type {any} */ one) => one.pair.includes(first) && one.pair.includes(second) && first !== second,
    );
    const smallest = Math.min(...cameras.map((/** @type {Camera} */ c) => c.scale));
    const bent = record.bent && !record.shape ? 0.5 + Math.min(1, camera.scale / smallest) * (record.border - 0.5) : 0.5;
    const border = bent + part * (0.5 - bent);
    const line = record.pen ? (record.pen.width_px * camera.scale) / cameras[first].scale : 0;
    const ink = (style.ink ?? record.pen?.rgb ?? [0, 0, 0]).map((/** @type {number} */ v) => v / 255);
    const paints = record.paints.slice(0, MOST_PAINTS);
    const shown = paints.map((/** @type {number[]} */ paint, /** @type {number} */ i) => style.colors[i] ?? paint);
    const changed = JSON.stringify(shown) !== JSON.stringify(paints);
    /** @type {Record<string, any>} */
    const common = {
      ...cameraUniforms(camera),
      layers: taps,
      sizes: taps.flatMap((i) => cameras[Math.max(i, 0)].size),
      paint: this.paint,
      whole: this.whole,
      about: this.about,
      depth_range: record.depths,
      depths: targets.surface.textures[0],
      still: style.still,
      edge_steps: record.edgeSteps,
      slack: record.slack * record.height,
      ...(paired ? cameraUniforms(paired.camera, "pair") : {}),
      flow: (paired ?? this.flows[0])?.flow ?? this.none,
      flows: Boolean(paired),
      sign: paired && paired.pair[0] === first ? 1 : -1,
      share,
      border,
      part,
      ink,
      tones: padded(paints),
      old_paints: padded(paints),
      new_paints: padded(shown),
      count: paints.length,
      shadow: record.shadow ?? [1, 1, 1],
      changed,
    };
    taps.forEach((i, tap) => Object.assign(common, cameraUniforms(cameras[Math.max(i, 0)], `views[${tap}]`)));

    if (!style.still) {
      const fine = seen.width / into.width > 0.75 ? 1 : 0.5;
      bind(targets.coarse, 1 / CELL);
      this.coarse.use({ rays: field, reach: line + 4 + CELL / 2, fine }).fill();
      const moving = { ...common, depths, rays: field, fine, line, ...this.styleOf(line) };
      bind(targets.colors, 0.5);
      this.colors.use(moving).fill();
      bind(into);
      const [coarse, colors] = [targets.coarse.textures[0], targets.colors.textures[0]];
      this.fast.use({ ...moving, coarse, colors }).fill();
      return null;
    }
    bind(targets.surface);
    this.surface.use({ depths, middle: (record.depths[0] + record.depths[1]) / 2 }).fill();
    bind(targets.masks);
    this.masks.use(common).fill();
    bind(targets.candidates);
    this.candidates
      .use({
        ...common,
        masks: targets.masks.textures[0],
        field,
        labels,
      })
      .fill();
    const [said, weights, one, two, three, own] = targets.candidates.textures;
    bind(targets.vote);
    this.vote.use({ said, weights, first: one, second: two, third: three }).fill();

    let voted = targets.vote.textures[0];
    if (record.shape) {
      bind(targets.slivers);
      const reach = record.sliver * record.height * camera.scale;
      this.slivers.use({ ...common, voted, first: one, reach, apart: record.slack * record.height }).fill();
      voted = targets.slivers.textures[0];
    }
    const before = voted;
    if (changed) {
      bind(targets.recolor);
      this.recolor.use({ ...common, voted }).fill();
      voted = targets.recolor.textures[0];
    }
    const plain = part > 0 && !style.ink && JSON.stringify(record.pen) === JSON.stringify(record.outline);
    /** @param {import("./gl.js").Texture | null} crumbs */
    const finish = (crumbs) => {
      bind(targets.rim);
      this.rim.use({ ...common, field, own, crumbs: crumbs ?? this.none, crumby: Boolean(crumbs) }).fill();
      let [from, to] = [targets.rim, targets.flood];
      for (let reach = 2 ** Math.ceil(Math.log2(line + 2)) / 2; line > 0 && reach >= 1; reach /= 2) {
        bind(to);
        this.flood.use({ places: from.textures[0], reach }).fill();
        [from, to] = [to, from];
      }
      bind(into);
      this.compose.use({ ...common, places: from.textures[0], voted, before, field, own, line, plain, style: lines ?? this.none, styled: Boolean(lines) }).fill();
    };
    finish(null);
    bind(targets.inside);
    this.inside.use({ places: targets.rim.textures[0] }).fill();
    const { area, hole, height } = record.crumb;
    const finer = ((record.height * camera.scale) / height) ** 2;
    const torn = record.bent && !record.shape;
    const { gl } = this;
    return async () => {
      const mask = await this.reader.read(targets.inside);
      const crumbs = crumbsOf(mask, into.width, into.height, area * finer, (torn ? hole : area) * finer);
      if (!crumbs) return null;
      return () => {
        const texture = makeTexture(gl, gl.TEXTURE_2D, gl.R8, [into.width, into.height], crumbs, false);
        finish(texture);
        gl.deleteTexture(texture.texture);
      };
    };
  }
}
