// All that is known of the scene: its clusters as they were sent, and the light at the joints of their elements.

import type { Geometry, Hello, Light, Places, Rgb, Surface } from "./protocol.js";
import { Joints } from "./weld.js";

/** A cluster with its light. */
export interface Cluster extends Geometry {
  irradiance: Float32Array;
  /** The joint of each corner. */
  joints: Uint32Array;
  /** Where the texels of each element begin, or −1. */
  texelsOf: Int32Array;
  /** The patch of each element, counted from the cluster's first. */
  patchOf: Uint16Array | Uint32Array;
}

/** What is known of an element. */
export interface ElementFacts {
  element: number;
  patch: number;
  cluster: number;
  object: string;
  reflectance: Rgb;
  exitance: Rgb;
  /** Not a number where other geometry covers the element. */
  irradiance: Rgb;
  radiosity: Rgb;
  owner: number;
  holder: number;
}

/** Texels in a row of the texture that holds the joints' light. */
export const ROW = 2048;

/** Photometric sum: lux where the scene is photometric. */
export function photometric([r, g, b]: Rgb): number {
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

export class World {
  readonly clusters: (Cluster | undefined)[];
  places: Places;
  /** Irradiance at the joints: four numbers each, the last is 1 where it is known. */
  light = new Float32Array(4 * ROW);
  jointCount = 0;
  /** Elements around each joint: where their list begins. */
  private first = new Uint32Array(1);
  /** Elements around the joints: their cluster, and their number in it. */
  private around = new Uint32Array(0);
  private stamp = new Uint32Array(0);
  private pass = 0;

  constructor(readonly hello: Hello) {
    this.clusters = new Array<Cluster | undefined>(hello.clusters);
    this.places = { owners: new Uint16Array(hello.clusters), holders: new Uint16Array(hello.patches) };
  }

  elementCount(cluster: number): number {
    return this.clusters[cluster]?.borders.length ?? 0;
  }

  /** Takes the geometry of a cluster; its light is dark again. */
  reshape(geometry: Geometry): void {
    const count = geometry.borders.length;
    const patchOf = new Uint32Array(count);
    const texelsOf = new Int32Array(count).fill(-1);
    let [element, texels] = [0, 0];
    for (let patch = 0; 3 * patch < geometry.patches.length; patch++) {
      const [elements, textured] = [geometry.patches[3 * patch + 1]!, geometry.patches[3 * patch + 2]!];
      for (const end = element + elements; element < end; element++) {
        patchOf[element] = patch;
        if (textured) texelsOf[element] = 8 * texels++;
      }
    }
    this.clusters[geometry.cluster] = {
      ...geometry,
      irradiance: new Float32Array(3 * count),
      joints: new Uint32Array(4 * count),
      texelsOf,
      patchOf,
    };
  }

  /** Finds the joints of all elements: after geometry has come. */
  weld(): void {
    const { hello } = this;
    const [low, high] = hello.bounds;
    const diagonal = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    const joints = new Joints(Math.max(diagonal * 2e-6, 1e-6), hello.elements);
    let total = 0;
    for (const cluster of this.clusters) {
      if (!cluster) continue;
      total += cluster.borders.length;
      weldCluster(cluster, joints);
    }
    this.jointCount = joints.count;
    this.light = new Float32Array(4 * ROW * Math.max(1, Math.ceil(joints.count / ROW)));
    this.stamp = new Uint32Array(joints.count);
    this.pass = 0;
    this.list(total);
    this.relight(this.clusters.keys());
  }

  /** Lists the elements around each joint. */
  private list(total: number): void {
    const first = new Uint32Array(this.jointCount + 1);
    const each = (visit: (joint: number, cluster: number, element: number) => void) => {
      this.clusters.forEach((cluster, number) => {
        if (!cluster) return;
        const { joints } = cluster;
        for (let corner = 0; corner < joints.length; corner++) {
          // A triangle repeats its third corner.
          if (corner % 4 === 3 && joints[corner] === joints[corner - 1]) continue;
          visit(joints[corner]!, number, corner >> 2);
        }
      });
    };
    each((joint) => first[joint + 1]!++);
    for (let joint = 0; joint < this.jointCount; joint++) first[joint + 1]! += first[joint]!;
    const end = first.slice();
    this.around = new Uint32Array(8 * total);
    each((joint, cluster, element) => {
      const place = 2 * end[joint]!++;
      this.around[place] = cluster;
      this.around[place + 1] = element;
    });
    this.first = first;
  }

  /** Takes the light of a cluster; [`relight`] shows it. */
  take({ cluster, irradiance }: Light): void {
    this.clusters[cluster]?.irradiance.set(irradiance);
  }

  /** Computes the light at the joints of some clusters; gives the first and last rows of the texture that have changed. */
  relight(clusters: Iterable<number>): [number, number][] {
    this.pass++;
    const rows = new Set<number>();
    for (const number of clusters) {
      for (const joint of this.clusters[number]?.joints ?? []) {
        if (this.stamp[joint] === this.pass) continue;
        this.stamp[joint] = this.pass;
        this.relightJoint(joint);
        rows.add(Math.floor(joint / ROW));
      }
    }
    const runs: [number, number][] = [];
    for (const row of [...rows].sort((a, b) => a - b)) {
      const last = runs.at(-1);
      if (last && last[1] === row - 1) last[1] = row;
      else runs.push([row, row]);
    }
    return runs;
  }

  private relightJoint(joint: number): void {
    let [r, g, b, known] = [0, 0, 0, 0];
    for (let k = this.first[joint]!; k < this.first[joint + 1]!; k++) {
      const { irradiance } = this.clusters[this.around[2 * k]!]!;
      const at = 3 * this.around[2 * k + 1]!;
      if (Number.isNaN(irradiance[at]!)) continue;
      r += irradiance[at]!;
      g += irradiance[at + 1]!;
      b += irradiance[at + 2]!;
      known++;
    }
    const scale = known ? 1 / known : 0;
    const at = 4 * joint;
    this.light[at] = r * scale;
    this.light[at + 1] = g * scale;
    this.light[at + 2] = b * scale;
    this.light[at + 3] = known ? 1 : 0;
  }

  /** Photometric irradiance of an element. */
  illuminance(cluster: number, k: number, ambient: Rgb): number {
    const { irradiance } = this.clusters[cluster]!;
    return photometric([0, 1, 2].map((c) => irradiance[3 * k + c]! + ambient[c]!) as Rgb);
  }

  /** Photometric radiance of an element. */
  radiance(cluster: number, k: number, ambient: Rgb): number {
    const { irradiance, colours, emission } = this.clusters[cluster]!;
    const emitted = emission.get(k);
    const of = (c: number) =>
      ((colours[4 * k + c]! / 65535) * (irradiance[3 * k + c]! + ambient[c]!) + (emitted?.[c] ?? 0)) / Math.PI;
    return photometric([of(0), of(1), of(2)]);
  }

  /** The surface of an element. */
  surface(cluster: number, k: number): Surface | undefined {
    const { patches, patchOf } = this.clusters[cluster]!;
    return this.hello.surfaces[patches[3 * patchOf[k]!]!];
  }

  /** What is known of an element. */
  facts(cluster: number, k: number): ElementFacts | undefined {
    const found = this.clusters[cluster];
    if (!found || k >= found.borders.length) return undefined;
    const three = (from: ArrayLike<number>, at: number, unit = 1): Rgb =>
      [from[at]! / unit, from[at + 1]! / unit, from[at + 2]! / unit];
    const irradiance = three(found.irradiance, 3 * k);
    const reflectance = three(found.colours, 4 * k, 65535);
    const exitance = found.emission.get(k) ?? [0, 0, 0];
    const radiosity = irradiance.map((e, c) => exitance[c]! + reflectance[c]! * (e || 0)) as Rgb;
    const patch = found.firstPatch + found.patchOf[k]!;
    return {
      element: found.firstElement + k,
      patch,
      cluster,
      object: this.surface(cluster, k)?.name ?? "",
      reflectance,
      exitance,
      irradiance,
      radiosity,
      owner: this.places.owners[cluster] ?? 0,
      holder: this.places.holders[patch] ?? 0,
    };
  }
}

/** Finds the joints of a cluster's elements. */
function weldCluster(cluster: Cluster, joints: Joints): void {
  const { positions: p, corners } = cluster;
  // Most vertices are met again with the same normal.
  const vertices = p.length / 3;
  const known = new Int32Array(vertices).fill(-1);
  const normalOf = new Float32Array(3 * vertices);
  for (let k = 0; k < cluster.borders.length; k++) {
    const [a, b, c, d] = [corners[4 * k]!, corners[4 * k + 1]!, corners[4 * k + 2]!, corners[4 * k + 3]!];
    // The cross product of the diagonals; of a triangle, whose fourth corner is its third, of two edges.
    const [ux, uy, uz] = [p[3 * c]! - p[3 * a]!, p[3 * c + 1]! - p[3 * a + 1]!, p[3 * c + 2]! - p[3 * a + 2]!];
    const [vx, vy, vz] = [p[3 * d]! - p[3 * b]!, p[3 * d + 1]! - p[3 * b + 1]!, p[3 * d + 2]! - p[3 * b + 2]!];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(x, y, z) || 1;
    const [nx, ny, nz] = [x / length, y / length, z / length];
    for (let corner = 4 * k; corner < 4 * k + 4; corner++) {
      const v = corners[corner]!;
      const n = 3 * v;
      const same = known[v]! >= 0 && normalOf[n]! * nx + normalOf[n + 1]! * ny + normalOf[n + 2]! * nz > 0.9999;
      if (!same) {
        known[v] = joints.find(p[n]!, p[n + 1]!, p[n + 2]!, nx, ny, nz);
        normalOf.set([nx, ny, nz], n);
      }
      cluster.joints[corner] = known[v]!;
    }
  }
}
