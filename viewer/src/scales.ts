// Colours and exposure that follow from the light: as the library chooses them for pictures.

import * as THREE from "three";
import type { Seen } from "./batches.js";
import type { World } from "./world.js";
import type { Rgb } from "./protocol.js";

/** A scale of false colour. */
export interface Scale {
  low: number;
  high: number;
  logarithmic: boolean;
}

/** A value below which a share of sorted ones lies. */
function quantile(sorted: number[], share: number): number {
  return sorted[Math.floor((sorted.length - 1) * share)] ?? 0;
}

/**
 * Display value of radiance 1: middle grey for the logarithmic mean of what is seen and does not emit, but with the bright
 * end neither burnt out nor dull. Nothing if all is dark.
 */
export function automaticExposure(world: World, seen: Seen[], ambient: Rgb, filmic: boolean): number | undefined {
  const radiances = (emitting: boolean) =>
    seen
      .filter(({ cluster, k }) => world.clusters[cluster]!.emission.has(k) === emitting)
      .map(({ cluster, k }) => world.radiance(cluster, k, ambient))
      .filter((radiance) => radiance > 0 && Number.isFinite(radiance))
      .sort((a, b) => a - b);
  let lit = radiances(false);
  // Nothing but lamps.
  if (lit.length === 0) lit = radiances(true);
  if (lit.length === 0) return undefined;
  const bright = quantile(lit, 0.98);
  const mean = lit.reduce((sum, radiance) => sum + Math.log(Math.max(radiance, bright / 1e3)), 0) / lit.length;
  return Math.min(Math.max(0.18 / Math.exp(mean), 0.5 / bright), (filmic ? 2 : 1) / bright);
}

/** The scale of the illuminance that is seen: between round numbers, logarithmic if it is wide. */
export function automaticScale(world: World, seen: Seen[], ambient: Rgb): Scale {
  const values = seen.map(({ cluster, k }) => world.illuminance(cluster, k, ambient)).filter((value) => value > 0);
  if (values.length === 0) return { low: 0, high: 1, logarithmic: false };
  values.sort((a, b) => a - b);
  const [low, high] = [quantile(values, 0.05), quantile(values, 0.995)];
  const logarithmic = high > 100 * low;
  return logarithmic
    ? { low: round(Math.max(low, high * 1e-4), false), high: round(high, true), logarithmic }
    : { low: 0, high: round(high, true), logarithmic };
}

/** The nearest of 1, 2, 5 × 10ⁿ that is not below, or not above, a positive number. */
function round(value: number, up: boolean): number {
  const power = Math.floor(Math.log10(value));
  const numbers = [power - 1, power, power + 1].flatMap((p) => [1, 2, 5].map((digit) => Number(`${digit}e${p}`)));
  return up ? Math.min(...numbers.filter((n) => n >= value)) : Math.max(...numbers.filter((n) => n <= value));
}

/** Values to be marked on a scale, with their places from 0 to 1. */
export function marks({ low, high, logarithmic }: Scale): [number, number][] {
  if (!logarithmic) return [0, 1, 2, 3, 4, 5].map((k) => [low + ((high - low) * k) / 5, k / 5]);
  const inner = [];
  for (let p = Math.ceil(Math.log10(low * 1.01)); 10 ** p < high * 0.99; p++) inner.push(Number(`1e${p}`));
  return [low, ...inner, high].map((value) => [value, Math.log(value / low) / Math.log(high / low)]);
}

/** Turbo (Mikhailov 2019) by the polynomials of d3, as in pictures: 0 to 255. */
export function turbo(t: number): Rgb {
  const clamp = (x: number) => Math.max(0, Math.min(255, Math.round(x)));
  return [
    clamp(34.61 + t * (1172.33 - t * (10793.56 - t * (33300.12 - t * (38394.49 - t * 14825.05))))),
    clamp(23.31 + t * (557.33 + t * (1225.33 - t * (3574.96 - t * (1073.77 + t * 707.56))))),
    clamp(27.2 + t * (3211.1 - t * (15327.97 - t * (27814 - t * (22569.18 - t * 6838.66))))),
  ];
}

/** The colours of false colour as a texture. */
export function turboTexture(): THREE.DataTexture {
  const data = new Uint8Array(4 * 256);
  for (let k = 0; k < 256; k++) data.set([...turbo(k / 255), 255], 4 * k);
  const texture = new THREE.DataTexture(data, 256, 1);
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
