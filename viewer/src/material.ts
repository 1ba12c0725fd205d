// How surfaces are drawn. Light lies in a texture, one texel for each joint, so that new light means new texels alone.

import * as THREE from "three";
import type { Rgb } from "./protocol.js";
import { ROW } from "./world.js";

/** What is shown. */
export type Quantity = "light" | "illuminance" | "owners" | "holders";

const QUANTITIES: Quantity[] = ["light", "illuminance", "owners", "holders"];

const VERTEX = /* glsl */ `
  // Pixels by which elements reach over their edges to fill gaps; and by which fillings, and what is dark, stand back.
  #define OVERLAP 0.7
  #define FILL_BEHIND 0.4
  #define DARK_BEHIND 1.5
  // Display value of white, times π, below which something is dark.
  #define DARK 0.08
  precision highp sampler2D;
  in uint joint;     // its upper byte: bits of edges that are edges of the patch, and of triangles
  in vec4 colour;    // reflectance and coverage
  in vec3 exitance;
  in vec2 texel;
  in vec3 outward;   // from the element's middle
  in uvec2 ranks;
  uniform float pixel; // its size, as a share of its distance
  uniform bool fill;
  uniform float exposure;
  uniform sampler2D irradiance;
  out vec3 vIrradiance;
  out vec4 vColour;
  out vec3 vExitance;
  out vec3 vPlace;
  out vec2 vWithin;
  out vec2 vTexel;
  flat out uint vBits;
  flat out uvec2 vRanks;
  flat out uint vDark;

  void main() {
    int number = int(joint & 0xffffffu);
    vIrradiance = texelFetch(irradiance, ivec2(number % ${ROW}, number / ${ROW}), 0).rgb;
    vColour = colour;
    vExitance = exitance;
    vTexel = texel;
    vBits = joint >> 24;
    vRanks = ranks;
    int corner = gl_VertexID & 3;
    bool triangle = (vBits & 16u) != 0u;
    vWithin = triangle ? vec2(corner == 1, corner >= 2) : vec2(corner == 1 || corner == 2, corner >= 2);
    vec4 place = modelViewMatrix * vec4(position, 1.0);
    vDark = dot(vIrradiance, vec3(0.2, 0.7, 0.1)) * exposure < DARK ? 1u : 0u;
    if (fill) place.xyz += mat3(modelViewMatrix) * outward * (OVERLAP * pixel * -place.z);
    place.xyz *= 1.0 + pixel * (fill ? FILL_BEHIND : vDark == 1u ? DARK_BEHIND : 0.0);
    vPlace = place.xyz;
    gl_Position = projectionMatrix * place;
  }
`;

const FRAGMENT = /* glsl */ `
  precision highp float;
  precision highp sampler2D;
  in vec3 vIrradiance;
  in vec4 vColour;
  in vec3 vExitance;
  in vec3 vPlace;
  in vec2 vWithin;
  in vec2 vTexel;
  flat in uint vBits;
  flat in uvec2 vRanks;
  flat in uint vDark;
  uniform int quantity;
  uniform bool fill;
  uniform float exposure;
  uniform bool filmic;
  uniform vec3 ambient;
  uniform int wires;
  uniform vec3 scale;        // low, high, 1 if logarithmic
  uniform sampler2D colours; // of false colour
  #ifdef TEXTURED
  uniform sampler2D texels;
  uniform vec3 factor;
  uniform float cutoff;
  #endif
  out vec4 shown;

  // The curve fitted to the ACES reference by Narkowicz (2015), as in pictures.
  vec3 tone(vec3 x) {
    x = clamp(x, 0.0, 1e4);
    return filmic ? min(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 1.0) : min(x, 1.0);
  }

  // IEC 61966-2-1.
  vec3 encode(vec3 x) {
    return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, x));
  }

  vec3 falseColour(float value) {
    float low = scale.x, high = scale.y;
    float at = scale.z > 0.5 ? log(max(value, low) / low) / log(high / low) : (value - low) / (high - low);
    return texture(colours, vec2(clamp(at, 0.0, 1.0) * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
  }

  // Colours of ranks: hues by the golden angle are told apart, however many there are.
  vec3 rankColour(uint rank, vec3 normal) {
    float hue = fract(float(rank) * 0.618034 + 0.58);
    vec3 pure = clamp(abs(fract(hue + vec3(0.0, 2.0 / 3.0, 1.0 / 3.0)) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
    return mix(vec3(0.8), pure, 0.62) * (0.75 + 0.25 * abs(normal.z));
  }

  // How near an edge is, in pixels: 1 on it.
  float edges(uint bits) {
    vec2 d = max(fwidth(vWithin), vec2(1e-6));
    bool triangle = (vBits & 16u) != 0u;
    float slant = vWithin.x + vWithin.y;
    vec4 distances = triangle
      ? vec4(vWithin.y / d.y, (1.0 - slant) / max(fwidth(slant), 1e-6), vWithin.x / d.x, 1e3)
      : vec4(vWithin.y / d.y, (1.0 - vWithin.x) / d.x, (1.0 - vWithin.y) / d.y, vWithin.x / d.x);
    float near = 1e3;
    for (int edge = 0; edge < 4; edge++) {
      if ((bits >> edge & 1u) != 0u) near = min(near, distances[edge]);
    }
    // Where elements are hardly larger than pixels there would be lines only.
    return (1.0 - smoothstep(0.4, 1.4, near)) * (1.0 - smoothstep(0.15, 0.4, max(d.x, d.y)));
  }

  // Screen-door transparency: no order is needed.
  float door() {
    uvec2 p = uvec2(gl_FragCoord.xy) & 3u;
    uint x = p.x ^ p.y, y = p.y;
    uint k = (x & 1u) << 3 | (y & 1u) << 2 | (x & 2u) | (y & 2u) >> 1;
    return (float(k) + 0.5) / 16.0;
  }

  void main() {
    vec3 reflectance = vColour.rgb * vColour.rgb;
    float coverage = vColour.a;
    #ifdef TEXTURED
    vec4 texel = texture(texels, vTexel);
    reflectance = min(texel.rgb * factor, 0.95);
    if (cutoff > 0.0) coverage = texel.a < cutoff ? 0.0 : 1.0;
    #endif
    if (coverage < 0.999 && coverage < door()) discard;
    // Insides of closed things would draw lines around them.
    if (fill && vDark == 1u) discard;
    vec3 light = vIrradiance + ambient;
    vec3 normal = normalize(cross(dFdx(vPlace), dFdy(vPlace)));
    vec3 colour;
    if (quantity == 0) colour = encode(tone((reflectance * light + vExitance) / 3.14159265 * exposure));
    else if (quantity == 1) colour = falseColour(dot(light, vec3(0.2126, 0.7152, 0.0722)));
    else colour = rankColour(quantity == 2 ? vRanks.x : vRanks.y, normal);
    float line = 0.0;
    if ((wires & 2) != 0) line = 0.45 * edges(15u);
    if ((wires & 1) != 0) line = max(line, 0.85 * edges(vBits));
    vec3 ink = dot(colour, vec3(0.3, 0.6, 0.1)) > 0.35 ? vec3(0.0) : vec3(0.75);
    shown = vec4(mix(colour, ink, line), 1.0);
  }
`;

const PICK_VERTEX = /* glsl */ `
  flat out int vElement;
  void main() {
    vElement = gl_VertexID >> 2;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }
`;

const PICK_FRAGMENT = /* glsl */ `
  precision highp float;
  flat in int vElement;
  uniform int first;
  out vec4 number;
  void main() {
    int k = first + vElement + 1;
    number = vec4(k & 255, k >> 8 & 255, k >> 16 & 255, k >> 24 & 255) / 255.0;
  }
`;

/** The material of all surfaces. */
export function surfaceMaterial(): THREE.RawShaderMaterial {
  const material = new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: HEAD + VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: {
      irradiance: { value: null },
      pixel: { value: 0 },
      fill: { value: false },
      quantity: { value: 0 },
      exposure: { value: 1 },
      filmic: { value: true },
      ambient: { value: new THREE.Vector3() },
      wires: { value: 0 },
      scale: { value: new THREE.Vector3(0, 1, 0) },
      colours: { value: null },
    },
  });
  Object.assign(material.defaultAttributeValues, { exitance: [0, 0, 0], texel: [0, 0] });
  return material;
}

/**
 * The material that fills gaps: where a corner meets the middle of a longer edge, rounding leaves some, less than a pixel
 * wide. Elements reach over their edges, a little behind where they are. What is dark, as the insides of closed things are,
 * stands back further, or it would look out of every gap.
 */
export function fillMaterial(surface: THREE.RawShaderMaterial): THREE.RawShaderMaterial {
  const material = surface.clone();
  material.uniforms = { ...surface.uniforms, fill: { value: true } };
  Object.assign(material.defaultAttributeValues, { exitance: [0, 0, 0], texel: [0, 0] });
  return material;
}

/** The material by which the element under the pointer is found. */
export function pickMaterial(): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: HEAD + PICK_VERTEX,
    fragmentShader: PICK_FRAGMENT,
    uniforms: { first: { value: 0 } },
    blending: THREE.NoBlending,
  });
}

const HEAD = /* glsl */ `
  precision highp float;
  precision highp int;
  uniform mat4 modelViewMatrix;
  uniform mat4 projectionMatrix;
  in vec3 position;
`;

/** What the screen shows of a radiance, as the shader has it. */
export function shown(radiance: Rgb, exposure: number, filmic: boolean): Rgb {
  return radiance.map((l) => {
    const x = Math.min(Math.max(l * exposure, 0), 1e4);
    const toned = Math.min(filmic ? (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14) : x, 1);
    return toned <= 0.0031308 ? 12.92 * toned : 1.055 * toned ** (1 / 2.4) - 0.055;
  }) as Rgb;
}

/** The number of a quantity in the shader. */
export function quantityNumber(quantity: Quantity): number {
  return QUANTITIES.indexOf(quantity);
}

/** The colour of a rank, as the shader has it on a surface that faces the eye. */
export function rankColour(rank: number): string {
  const hue = (rank * 0.618034 + 0.58) % 1;
  const part = (offset: number) => {
    const pure = Math.min(Math.max(Math.abs(((hue + offset) % 1) * 6 - 3) - 1, 0), 1);
    return Math.round(255 * (0.8 + (pure - 0.8) * 0.62));
  };
  return `rgb(${part(0)} ${part(2 / 3)} ${part(1 / 3)})`;
}
