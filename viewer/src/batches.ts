// The clusters as the graphics hardware takes them: buffers for many clusters at a time, which are neighbours, so that what
// is out of sight is left out.

import * as THREE from "three";
import { fillMaterial, pickMaterial, surfaceMaterial } from "./material.js";
import { COVERED } from "./protocol.js";
import { Textures } from "./textures.js";
import { ROW, type Cluster, type World } from "./world.js";

/** Elements of a batch: so that sixteen bits tell its corners apart. */
const MOST_ELEMENTS = 16384;

/** Bit of the joint's upper byte: the element is a triangle. */
const TRIANGLE = 16;

/** An element: its cluster, and its number in it. */
export interface Seen {
  cluster: number;
  k: number;
}

interface Batch {
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial[]>;
  clusters: number[];
  first: number;
  count: number;
}

export class Batches {
  readonly scene = new THREE.Scene();
  readonly material = surfaceMaterial();
  private readonly filling = fillMaterial(this.material);
  private readonly picking = pickMaterial();
  private batches: Batch[] = [];
  private world: World | null = null;
  private readonly textures: Textures;
  private texture: THREE.DataTexture | null = null;
  /** Where each cluster's elements begin in the order of drawing. */
  private starts: { cluster: number; first: number }[] = [];

  /** `changed` is called when there is more to be seen. */
  constructor(changed: () => void) {
    this.textures = new Textures(this.material, changed);
  }

  /** Makes all buffers anew. */
  build(world: World): void {
    this.clear();
    if (world !== this.world) this.textures.clear();
    this.world = world;
    this.texture = new THREE.DataTexture(
      world.light, ROW, world.light.length / 4 / ROW, THREE.RGBAFormat, THREE.FloatType,
    );
    this.texture.needsUpdate = true;
    this.material.uniforms.irradiance!.value = this.texture;
    let [clusters, count, first] = [[] as number[], 0, 0];
    const flush = () => {
      if (count > 0) this.batches.push(this.batch(world, clusters, first, count));
      first += count;
      [clusters, count] = [[], 0];
    };
    world.clusters.forEach((cluster, number) => {
      if (!cluster) return;
      const elements = cluster.borders.length;
      if (count > 0 && count + elements > MOST_ELEMENTS) flush();
      this.starts.push({ cluster: number, first: first + count });
      clusters.push(number);
      count += elements;
    });
    flush();
    this.rank(world);
  }

  /** Hands the graphics hardware the rows of light that have changed. */
  relight(rows: [number, number][]): void {
    if (!this.texture || rows.length === 0) return;
    for (const [from, to] of rows) {
      for (let row = from; row <= to; row++) this.texture.addUpdateRange(4 * ROW * row, 4 * ROW);
    }
    this.texture.needsUpdate = true;
  }

  /** Takes who owns and who holds what. */
  rank(world: World): void {
    for (const { mesh, clusters } of this.batches) {
      const ranks = mesh.geometry.getAttribute("ranks") as THREE.BufferAttribute;
      let at = 0;
      for (const number of clusters) {
        const cluster = world.clusters[number]!;
        const owner = world.places.owners[number] ?? 0;
        for (let k = 0; k < cluster.borders.length; k++) {
          const holder = world.places.holders[cluster.firstPatch + cluster.patchOf[k]!] ?? 0;
          for (let corner = 0; corner < 4; corner++) {
            ranks.array[at++] = owner;
            ranks.array[at++] = holder;
          }
        }
      }
      ranks.needsUpdate = true;
    }
  }

  private batch(world: World, clusters: number[], first: number, count: number): Batch {
    const corners = 4 * count;
    const positions = new Float32Array(3 * corners);
    const joints = new Uint32Array(corners);
    const colours = new Uint8Array(4 * corners);
    const outward = new Int8Array(4 * corners);
    const drawn = new Map<THREE.RawShaderMaterial, number[]>([[this.material, []]]);
    const parts = clusters.map((number) => world.clusters[number]!);
    const exitance = parts.some((part) => part.emission.size > 0) ? new Float32Array(3 * corners) : null;
    const texel = parts.some((part) => part.texels.length > 0) ? new Float32Array(2 * corners) : null;
    let element = 0;
    for (const part of parts) {
      for (let k = 0; k < part.borders.length; k++, element++) {
        fill(part, k, element, { positions, joints, colours, outward, exitance, texel });
        if ((part.borders[k]! & COVERED) !== 0) continue;
        const texture = part.texelsOf[k]! < 0 ? null : world.surface(part.cluster, k)?.texture;
        const material = texture ? this.textures.material(texture) : this.material;
        if (!drawn.has(material)) drawn.set(material, []);
        drawn.get(material)!.push(4 * element);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("joint", new THREE.BufferAttribute(joints, 1));
    geometry.setAttribute("outward", new THREE.BufferAttribute(outward, 4, true));
    geometry.setAttribute("colour", new THREE.BufferAttribute(colours, 4, true));
    // Without it, three.js takes the material's default.
    if (exitance) geometry.setAttribute("exitance", new THREE.BufferAttribute(exitance, 3));
    const ranks = new THREE.BufferAttribute(new Uint16Array(2 * corners), 2);
    ranks.gpuType = THREE.IntType;
    geometry.setAttribute("ranks", ranks);
    if (texel) geometry.setAttribute("texel", new THREE.BufferAttribute(texel, 2));
    geometry.setIndex(new THREE.BufferAttribute(triangles([...drawn.values()], count, geometry), 1));
    geometry.computeBoundingSphere();
    const mesh = new THREE.Mesh(geometry, [...drawn.keys()]);
    mesh.matrixAutoUpdate = false;
    mesh.onBeforeRender = (_renderer, _scene, _camera, _geometry, material) => {
      if (material === this.picking) {
        this.picking.uniforms.first!.value = first;
        this.picking.uniformsNeedUpdate = true;
      }
    };
    this.scene.add(mesh);
    return { mesh, clusters, first, count };
  }

  /** Draws the scene; a pixel is so large a share of its distance. */
  draw(renderer: THREE.WebGLRenderer, camera: THREE.Camera, pixel: number): void {
    this.material.uniforms.pixel!.value = pixel;
    renderer.render(this.scene, camera);
    this.scene.overrideMaterial = this.filling;
    renderer.autoClear = false;
    renderer.render(this.scene, camera);
    renderer.autoClear = true;
    this.scene.overrideMaterial = null;
  }

  /** Draws the numbers of elements instead of their light: see [`elementAt`]. */
  drawNumbers(renderer: THREE.WebGLRenderer, camera: THREE.Camera): void {
    this.scene.overrideMaterial = this.picking;
    renderer.render(this.scene, camera);
    this.scene.overrideMaterial = null;
  }

  /** The element that was drawn as this number. */
  elementAt(number: number): Seen | undefined {
    if (number === 0) return undefined;
    let [low, high] = [0, this.starts.length];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.starts[middle]!.first <= number - 1) low = middle;
      else high = middle;
    }
    const start = this.starts[low];
    return start && { cluster: start.cluster, k: number - 1 - start.first };
  }

  private clear(): void {
    for (const { mesh } of this.batches) {
      mesh.geometry.dispose();
      this.scene.remove(mesh);
    }
    this.texture?.dispose();
    this.batches = [];
    this.starts = [];
  }
}

interface Buffers {
  positions: Float32Array;
  joints: Uint32Array;
  colours: Uint8Array;
  outward: Int8Array;
  exitance: Float32Array | null;
  texel: Float32Array | null;
}

/** Triangles of elements, by their first corners; each list makes a group with the material of its number. */
function triangles(lists: number[][], count: number, geometry: THREE.BufferGeometry): Uint16Array | Uint32Array {
  const index = count > MOST_ELEMENTS ? new Uint32Array(6 * count) : new Uint16Array(6 * count);
  let at = 0;
  lists.forEach((corners, material) => {
    geometry.addGroup(at, 6 * corners.length, material);
    for (const c of corners) {
      index.set([c, c + 1, c + 2, c, c + 2, c + 3], at);
      at += 6;
    }
  });
  return index.subarray(0, at);
}

/** Fills in the corners of an element. */
function fill(part: Cluster, k: number, element: number, buffers: Buffers): void {
  const { positions, joints, colours, outward, exitance, texel } = buffers;
  const triangle = part.corners[4 * k + 2] === part.corners[4 * k + 3];
  const bits = (part.borders[k]! & 15) | (triangle ? TRIANGLE : 0);
  // Eight bits tell dark colours apart better as square roots.
  const root = (c: number) => Math.round(255 * Math.sqrt(part.colours[4 * k + c]! / 65535));
  const [red, green, blue] = [root(0), root(1), root(2)];
  const coverage = Math.round(part.colours[4 * k + 3]! / 257);
  const emitted = part.emission.get(k);
  const middle = [0, 0, 0];
  for (let corner = 0; corner < 4; corner++) {
    const at = 4 * element + corner;
    const vertex = part.corners[4 * k + corner]!;
    for (let axis = 0; axis < 3; axis++) {
      const x = part.positions[3 * vertex + axis]!;
      positions[3 * at + axis] = x;
      middle[axis]! += x / 4;
    }
    joints[at] = (bits << 24) | part.joints[4 * k + corner]!;
    colours[4 * at] = red;
    colours[4 * at + 1] = green;
    colours[4 * at + 2] = blue;
    colours[4 * at + 3] = coverage;
    if (exitance && emitted) exitance.set(emitted, 3 * at);
    const place = part.texelsOf[k]! + 2 * corner;
    if (texel && part.texelsOf[k]! >= 0) texel.set(part.texels.subarray(place, place + 2), 2 * at);
  }
  for (let at = 4 * element; at < 4 * element + 4; at++) {
    const [x, y, z] = [0, 1, 2].map((axis) => positions[3 * at + axis]! - middle[axis]!) as [number, number, number];
    const length = Math.hypot(x, y, z) || 1;
    outward[4 * at] = (127 * x) / length;
    outward[4 * at + 1] = (127 * y) / length;
    outward[4 * at + 2] = (127 * z) / length;
  }
}
