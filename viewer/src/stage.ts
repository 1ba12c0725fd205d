// What is seen: the scene from the eye, drawn when something has changed.

import * as THREE from "three";
import { Batches, type Seen } from "./batches.js";
import { quantityNumber, shown, type Quantity } from "./material.js";
import { Navigation } from "./navigation.js";
import type { Hello, Rgb } from "./protocol.js";
import { turboTexture, type Scale } from "./scales.js";
import type { World } from "./world.js";

/** Size of the small pictures by which views, exposures and scales are chosen, pixels. */
const ROUGH = { width: 64, height: 40 };

/** Vertical fields of view inside and outside, degrees. */
const WIDE = 65;
const NARROW = 45;

/** The eye is at rest after so many milliseconds. */
const REST = 200;

export class Stage {
  readonly batches = new Batches(() => this.invalidate());
  readonly navigation: Navigation;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly under = new THREE.WebGLRenderTarget(1, 1);
  private stale = true;

  /** `settled` is called when the eye has come to rest. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    settled: () => void,
  ) {
    let waiting = 0;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    // Materials write what the screen shows.
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.setClearColor(0x000000);
    this.navigation = new Navigation(canvas, () => {
      this.invalidate();
      clearTimeout(waiting);
      waiting = window.setTimeout(settled, REST);
    });
    this.batches.material.uniforms.colours!.value = turboTexture();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.renderer.setAnimationLoop((now) => this.frame(now));
  }

  /** Something is to be drawn anew. */
  invalidate(): void {
    this.stale = true;
  }

  set(values: {
    quantity?: Quantity;
    exposure?: number;
    filmic?: boolean;
    ambient?: Rgb;
    wires?: number;
    scale?: Scale;
    sky?: Rgb;
  }): void {
    const u = this.batches.material.uniforms;
    if (values.quantity !== undefined) u.quantity!.value = quantityNumber(values.quantity);
    if (values.exposure !== undefined) u.exposure!.value = values.exposure;
    if (values.filmic !== undefined) u.filmic!.value = values.filmic;
    if (values.ambient) (u.ambient!.value as THREE.Vector3).set(...values.ambient);
    if (values.wires !== undefined) u.wires!.value = values.wires;
    if (values.scale) {
      const { low, high, logarithmic } = values.scale;
      (u.scale!.value as THREE.Vector3).set(low, high, logarithmic ? 1 : 0);
    }
    if (values.sky) {
      const { exposure, filmic } = u as { exposure: { value: number }; filmic: { value: boolean } };
      this.renderer.setClearColor(new THREE.Color(...shown(values.sky, exposure.value, filmic.value)));
    }
    this.invalidate();
  }

  /** The number under a place of the canvas, in its own pixels; 0 for nothing. */
  numberAt(x: number, y: number): number {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const { camera } = this.navigation;
    camera.setViewOffset(width, height, x, y, 1, 1);
    const [number] = this.numbers(1, 1);
    camera.clearViewOffset();
    return number ?? 0;
  }

  /** The elements that are seen, as often as they take a pixel of a small picture. */
  seen(): Seen[] {
    const seen: Seen[] = [];
    for (const number of this.numbers(ROUGH.width, ROUGH.height)) {
      const found = this.batches.elementAt(number);
      if (found) seen.push(found);
    }
    return seen;
  }

  /** Numbers of the elements that are seen, for each pixel of a small picture. */
  private numbers(width: number, height: number): Uint32Array {
    this.under.setSize(width, height);
    const colour = this.renderer.getClearColor(new THREE.Color());
    this.renderer.setRenderTarget(this.under);
    this.renderer.setClearColor(0x000000, 0);
    this.renderer.clear();
    this.batches.drawNumbers(this.renderer, this.navigation.camera);
    const bytes = new Uint8Array(4 * width * height);
    this.renderer.readRenderTargetPixels(this.under, 0, 0, width, height, bytes);
    this.renderer.setRenderTarget(null);
    this.renderer.setClearColor(colour, 1);
    return new Uint32Array(bytes.buffer);
  }

  /** Looks at the scene from beside it. */
  lookFromOutside(hello: Hello): void {
    const box = new Box(hello);
    this.navigation.look(box.outside(1, 1), box.middle, NARROW);
  }

  /** Chooses a view that shows much of what is lit: from inside of a closed room, from outside of anything else. */
  chooseView(world: World): void {
    const box = new Box(world.hello);
    const views: { eye: THREE.Vector3; fov: number; worth: number }[] = [];
    for (const [x, z] of [[0, 0], [0, 1], [1, 0], [1, 1], [0.5, 1], [0.5, 0], [0, 0.5], [1, 0.5]] as const) {
      views.push({ eye: box.at(0.5 + (x - 0.5) * 0.86, 0.55, 0.5 + (z - 0.5) * 0.86), fov: WIDE, worth: 0 });
      views.push({ eye: box.outside(x, z), fov: NARROW, worth: 0 });
    }
    for (const view of views) {
      this.navigation.look(view.eye, box.middle, view.fov);
      this.navigation.camera.updateMatrixWorld();
      const lit = new Set<string>();
      let weight = 0;
      for (const { cluster, k } of this.seen()) {
        const found = world.clusters[cluster]!;
        if (!(found.irradiance[3 * k]! > 0 || found.emission.has(k))) continue;
        // What is near stands in the way.
        const corner = new THREE.Vector3().fromArray(found.positions, 3 * found.corners[4 * k]!);
        weight += Math.min(corner.distanceTo(view.eye) / box.diagonal, 0.3);
        lit.add(`${cluster} ${k}`);
      }
      view.worth = weight * lit.size;
    }
    const best = views.reduce((a, b) => (b.worth > a.worth ? b : a));
    this.navigation.look(best.eye, box.middle, best.fov);
  }

  /** The present picture, as a file. */
  picture(): Promise<Blob | null> {
    this.draw();
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.navigation.resize(width, height);
    this.invalidate();
  }

  private frame(now: number): void {
    this.navigation.advance(now);
    if (!this.stale) return;
    this.stale = false;
    this.draw();
  }

  private draw(): void {
    const { camera } = this.navigation;
    const pixels = this.canvas.height / (2 * Math.tan(THREE.MathUtils.degToRad(camera.fov) / 2));
    this.batches.draw(this.renderer, camera, 1 / pixels);
  }
}

/** The box around a scene. */
class Box {
  readonly diagonal: number;
  readonly middle: THREE.Vector3;
  private readonly low: THREE.Vector3;
  private readonly size: THREE.Vector3;

  constructor(hello: Hello) {
    const [low, high] = hello.bounds;
    this.low = new THREE.Vector3(...low);
    this.size = new THREE.Vector3(...high).sub(this.low);
    this.diagonal = this.size.length();
    this.middle = this.at(0.5, 0.42, 0.5);
  }

  /** A place by shares of the sides. */
  at(x: number, y: number, z: number): THREE.Vector3 {
    return new THREE.Vector3(x, y, z).multiply(this.size).add(this.low);
  }

  /** A place beside it, past a place of its ground plan. */
  outside(x: number, z: number): THREE.Vector3 {
    const away = this.at(x, 0.8, z).sub(this.middle).normalize();
    return this.middle.clone().addScaledVector(away, 1.15 * this.diagonal);
  }
}
