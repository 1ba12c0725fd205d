// Colours and exposure that follow from the light: as the library chooses them for pictures.

import * as THREE from "three";
import { photometric, type Cluster, type World } from "./world.js";
import type { Rgb } from "./protocol.js";

/** Elements that are looked at: of more, some. */
const SAMPLES = 100_000;

/** A scale of false colour. */
export interface Scale {
  low: number;
  high: number;
  logarithmic: boolean;
}

/** Calls `visit` for elements spread evenly over the scene. */
function sample(world: World, visit: (cluster: Cluster, k: number) => void): void {
  const stride = Math.max(1, Math.ceil(world.hello.elements / SAMPLES));
  let next = 0;
  for (const cluster of world.clusters) {
    if (!cluster) continue;
    const count = cluster.borders.length;
    for (; next < count; next += stride) visit(cluster, next);
    next -= count;
  }
}

/** The share of the weight that lies below. */
function quantile(sorted: [number, number][], share: number): number {
  const total = sorted.reduce((sum, [, weight]) => sum + weight, 0);
  let below = 0;
  for (const [value, weight] of sorted) {
    below += weight;
    if (below >= share * total) return value;
  }
  return sorted.at(-1)?.[0] ?? 0;
}

/**
 * Display value of radiance 1: middle grey for the logarithmic mean of what does not emit, but with the bright end neither
 * burnt out nor dull. Nothing if all is dark.
 */
export function automaticExposure(world: World, ambient: Rgb): number | undefined {
  const lit: [number, number][] = [];
  const areas: number[] = [];
  sample(world, (cluster, k) => areas.push(cluster.areas[k]!));
  // What is cut coarsely does not decide alone.
  const largest = 4 * (areas.sort((a, b) => a - b)[areas.length >> 1] ?? 1);
  sample(world, (cluster, k) => {
    if (cluster.emission.has(k)) return;
    const of = (c: number) =>
      (cluster.colours[4 * k + c]! / 65535) * (cluster.irradiance[3 * k + c]! + ambient[c]!) / Math.PI;
    const radiance = photometric([of(0), of(1), of(2)]);
    if (radiance > 0 && Number.isFinite(radiance)) lit.push([radiance, Math.min(cluster.areas[k]!, largest)]);
  });
  if (lit.length === 0) return undefined;
  lit.sort((a, b) => a[0] - b[0]);
  const bright = quantile(lit, 0.95);
  let [sum, total] = [0, 0];
  for (const [radiance, weight] of lit) {
    sum += weight * Math.log(Math.max(radiance, bright / 1e3));
    total += weight;
  }
  const wanted = 0.18 / Math.exp(sum / total);
  const most = 1 / bright;
  return Math.max(wanted > most ? Math.sqrt(wanted * most) : wanted, 0.35 / bright);
}

/** The scale of illuminance: between round numbers, logarithmic if it is wide. */
export function automaticScale(world: World, ambient: Rgb): Scale {
  const values: [number, number][] = [];
  sample(world, (cluster, k) => {
    const of = (c: number) => cluster.irradiance[3 * k + c]! + ambient[c]!;
    const value = photometric([of(0), of(1), of(2)]);
    if (value > 0) values.push([value, 1]);
  });
  if (values.length === 0) return { low: 0, high: 1, logarithmic: false };
  values.sort((a, b) => a[0] - b[0]);
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
