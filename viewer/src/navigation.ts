// How the eye moves: round the scene, through it, or looking about.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Camera, Hello } from "./protocol.js";

export type Way = "orbit" | "walk" | "look";

/** Radians by which a pixel of dragging turns. */
const TURN = 0.004;

/** Radians per second by which arrow keys turn. */
const KEY_TURN = 1.2;

/** Directions of keys: right, up, back. */
const STEPS: Record<string, [number, number, number]> = {
  KeyW: [0, 0, -1],
  KeyS: [0, 0, 1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

const TURNS: Record<string, [number, number]> = {
  ArrowLeft: [1, 0],
  ArrowRight: [-1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};

export class Navigation {
  readonly camera = new THREE.PerspectiveCamera(60, 1, 0.01, 1000);
  private readonly orbit: OrbitControls;
  private current: Way = "orbit";
  private readonly held = new Set<string>();
  private pointer: number | null = null;
  private size = 1;
  private last = 0;
  /** Whether the user has moved. */
  moved = false;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly changed: () => void,
  ) {
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.enableDamping = false;
    this.orbit.addEventListener("change", changed);
    this.orbit.addEventListener("start", () => (this.moved = true));
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("pointerup", () => (this.pointer = null));
    canvas.addEventListener("pointercancel", () => (this.pointer = null));
    canvas.addEventListener("wheel", (event) => this.roll(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event, true));
    canvas.addEventListener("keyup", (event) => this.key(event, false));
    canvas.addEventListener("blur", () => this.held.clear());
  }

  get way(): Way {
    return this.current;
  }

  set way(way: Way) {
    this.current = way;
    this.orbit.enabled = way === "orbit";
    if (way === "orbit") this.aim(this.distance());
  }

  /** Fits speeds and depths to the scene. */
  begin(hello: Hello): void {
    const [low, high] = hello.bounds.map((corner) => new THREE.Vector3(...corner)) as [THREE.Vector3, THREE.Vector3];
    this.size = Math.max(low.distanceTo(high), 1e-6);
    this.camera.near = this.size * 2e-4;
    this.camera.far = this.size * 20;
    this.camera.updateProjectionMatrix();
  }

  /** Looks from a point at another. */
  look(eye: THREE.Vector3, target: THREE.Vector3, fieldOfView = 60): void {
    this.camera.fov = fieldOfView;
    this.camera.position.copy(eye);
    this.camera.lookAt(target);
    this.camera.updateProjectionMatrix();
    this.orbit.target.copy(target);
    this.orbit.update();
    this.changed();
  }

  /** Looks as a camera of the scene does. */
  take(camera: Camera): void {
    const matrix = new THREE.Matrix4().fromArray(camera.matrix.flat());
    matrix.decompose(this.camera.position, this.camera.quaternion, new THREE.Vector3());
    const distance = this.size / 4;
    // A view without perspective is one from far away.
    const angle = camera.field_of_view || 2 * Math.atan(camera.half_height / this.size);
    if (!camera.field_of_view) this.camera.translateZ(this.size);
    this.camera.fov = THREE.MathUtils.radToDeg(angle);
    this.camera.updateProjectionMatrix();
    this.aim(distance);
    this.changed();
  }

  resize(width: number, height: number): void {
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
  }

  /** Moves while keys are held; whether any is. */
  advance(now: number): boolean {
    const seconds = Math.min((now - this.last) / 1000, 0.1);
    this.last = now;
    if (this.held.size === 0) return false;
    const speed = this.size * 0.12 * (this.held.has("Shift") ? 4 : 1) * seconds;
    for (const key of this.held) {
      const step = STEPS[key];
      if (step && this.current === "walk") {
        const forward = new THREE.Vector3(step[0], 0, step[2]).applyQuaternion(this.camera.quaternion);
        forward.y += step[1];
        this.camera.position.addScaledVector(forward, speed);
      }
      const turn = TURNS[key];
      if (turn && this.current !== "orbit") this.turn(turn[0] * KEY_TURN * seconds, turn[1] * KEY_TURN * seconds);
    }
    this.changed();
    return true;
  }

  private distance(): number {
    return Math.max(this.camera.position.distanceTo(this.orbit.target), this.size * 0.05);
  }

  /** Puts what the eye orbits straight before it. */
  private aim(distance: number): void {
    const forward = new THREE.Vector3(0, 0, -1).applyQuaternion(this.camera.quaternion);
    this.orbit.target.copy(this.camera.position).addScaledVector(forward, distance);
    this.orbit.update();
  }

  private turn(yaw: number, pitch: number): void {
    const angles = new THREE.Euler().setFromQuaternion(this.camera.quaternion, "YXZ");
    const limit = Math.PI / 2 - 0.01;
    angles.set(Math.max(-limit, Math.min(limit, angles.x + pitch)), angles.y + yaw, 0);
    this.camera.quaternion.setFromEuler(angles);
    this.moved = true;
    this.changed();
  }

  private press(event: PointerEvent): void {
    this.canvas.focus({ preventScroll: true });
    if (this.current === "orbit") return;
    this.pointer = event.pointerId;
    this.canvas.setPointerCapture(event.pointerId);
  }

  private drag(event: PointerEvent): void {
    if (this.current === "orbit" || event.pointerId !== this.pointer) return;
    const zoom = this.camera.fov / 60;
    this.turn(event.movementX * TURN * zoom, event.movementY * TURN * zoom);
  }

  private roll(event: WheelEvent): void {
    if (this.current === "orbit") return;
    event.preventDefault();
    if (this.current === "look") {
      this.camera.fov = Math.max(5, Math.min(100, this.camera.fov * Math.exp(event.deltaY * 0.001)));
      this.camera.updateProjectionMatrix();
    } else {
      this.camera.translateZ(Math.sign(event.deltaY) * this.size * 0.02);
    }
    this.moved = true;
    this.changed();
  }

  private key(event: KeyboardEvent, down: boolean): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const name = event.key === "Shift" ? "Shift" : event.code;
    if (!(name in STEPS || name in TURNS || name === "Shift")) return;
    if (name in TURNS && this.current !== "orbit") event.preventDefault();
    if (down) this.held.add(name);
    else this.held.delete(name);
    this.moved ||= down;
    this.changed();
  }
}
