// The page: puts what the server says before the eye, and what the user wants before the server.

import { Connection, type Listener } from "./connection.js";
import type { Quantity } from "./material.js";
import type { Way } from "./navigation.js";
import { Panel, part } from "./panel.js";
import { readRecords, VERSION, type Rgb, type Status, type Words } from "./protocol.js";
import { automaticExposure, automaticScale, type Scale } from "./scales.js";
import { Stage } from "./stage.js";
import "./viewer.css";
import { World } from "./world.js";

/** Luminance 1.2 · 2^EV is white, as of `--exposure`. */
const WHITE = 1.2;

/** Milliseconds of a frame that new light may take. */
const FRAME_SHARE = 8;

/** Clusters whose light is computed together. */
const AT_A_TIME = 64;

class Page implements Listener {
  private readonly panel = new Panel();
  private readonly stage = new Stage(part<HTMLCanvasElement>("scene"), () => this.rest());
  private readonly connection: Connection;
  private world: World | null = null;
  private status: Status | null = null;
  private readonly reshaped = new Set<number>();
  private readonly relit = new Set<number>();
  private placed = false;
  private chosen = false;
  private scale: Scale = { low: 0, high: 1, logarithmic: false };
  private pointer: { x: number; y: number } | null = null;
  private pointed = false;

  constructor() {
    this.listen();
    this.panel.message("Waiting for the scene …");
    this.connection = new Connection(this);
  }

  connected(there: boolean): void {
    this.panel.connected(there);
  }

  words(words: Words): void {
    if ("hello" in words) {
      const { hello } = words;
      if (hello.protocol !== VERSION) {
        this.panel.message("This page is of another version than the server. Load it again.");
        throw new Error(`protocol ${hello.protocol}`);
      }
      const again = this.world?.hello.name === hello.name && this.world.hello.elements === hello.elements;
      this.world = new World(hello);
      this.panel.begin(hello);
      this.stage.navigation.begin(hello);
      if (again) return;
      // While it is dark there is nothing else to see.
      part<HTMLInputElement>("ambient").checked = hello.live;
      this.chosen = hello.cameras.length > 0;
      if (hello.cameras[0]) this.stage.navigation.take(hello.cameras[0]);
      else this.stage.lookFromOutside(hello);
    } else if ("status" in words) {
      this.status = words.status;
      this.panel.status(words.status);
      document.body.dataset.shots = String(words.status.shots);
      document.body.dataset.phase = words.status.phase;
    } else {
      this.panel.curves.set(words.curves.points);
    }
  }

  records(bytes: ArrayBuffer): void {
    const { world } = this;
    if (!world) return;
    const records = readRecords(bytes, world.hello, (cluster) => world.elementCount(cluster));
    if ("geometry" in records) {
      for (const geometry of records.geometry) {
        world.reshape(geometry);
        this.reshaped.add(geometry.cluster);
      }
    } else if ("light" in records) {
      for (const light of records.light) {
        world.take(light);
        this.relit.add(light.cluster);
      }
    } else {
      world.places = records.places;
      this.placed = true;
    }
  }

  async complete(): Promise<void> {
    const { world, stage } = this;
    if (!world) return;
    if (this.reshaped.size > 0) {
      world.weld();
      stage.batches.build(world);
      this.panel.message("");
    } else {
      await this.relight(world);
      if (world !== this.world) return;
      if (this.placed) stage.batches.rank(world);
    }
    const lit = (this.status?.unshot_share ?? 1) < 1;
    if (this.relit.size > 0 && lit && !this.chosen && !stage.navigation.moved) {
      this.chosen = true;
      stage.chooseView(world);
    }
    document.body.dataset.updates = String(Number(document.body.dataset.updates ?? 0) + 1);
    this.reshaped.clear();
    this.relit.clear();
    this.placed = false;
    this.apply();
    this.pointed = false;
  }

  /** Shows new light, a little in each frame. */
  private async relight(world: World): Promise<void> {
    const clusters = [...this.relit];
    // A server that is found again begins anew.
    for (let next = 0; next < clusters.length && world === this.world; ) {
      const begin = performance.now();
      while (next < clusters.length && performance.now() - begin < FRAME_SHARE) {
        this.stage.batches.relight(world.relight(clusters.slice(next, (next += AT_A_TIME))));
      }
      this.stage.invalidate();
      if (next < clusters.length) await new Promise((resolve) => setTimeout(resolve));
    }
  }

  /** Shows what the controls say. */
  private apply(): void {
    const { world } = this;
    const on = (id: string) => part<HTMLInputElement>(id).checked;
    const ambient: Rgb = on("ambient") ? (this.status?.ambient ?? [0, 0, 0]) : [0, 0, 0];
    const filmic = part<HTMLSelectElement>("tone").value === "filmic";
    const quantity = part<HTMLSelectElement>("quantity").value as Quantity;
    const slider = part<HTMLInputElement>("exposure");
    const automatic = on("auto") && quantity === "light";
    const seen = world && (automatic || quantity === "illuminance") ? this.stage.seen() : [];
    if (world && automatic) {
      const exposure = automaticExposure(world, seen, ambient, filmic);
      if (exposure !== undefined) slider.value = String(-Math.log2(exposure * WHITE));
    }
    if (world && quantity === "illuminance") this.scale = automaticScale(world, seen, ambient);
    part("ev").textContent = `EV ${Number(slider.value).toFixed(1)}`;
    this.panel.key(quantity, this.scale);
    this.stage.set({
      quantity,
      ambient,
      filmic,
      exposure: 1 / (WHITE * 2 ** Number(slider.value)),
      wires: (on("patches") ? 1 : 0) | (on("elements-wires") ? 2 : 0),
      scale: this.scale,
      sky: world?.hello.sky ?? [0, 0, 0],
    });
  }

  /** The eye has come to rest. */
  private rest(): void {
    if (part<HTMLInputElement>("auto").checked && part<HTMLSelectElement>("quantity").value === "light") this.apply();
  }

  /** Reads the value under the pointer, at most once a frame. */
  private point(): void {
    const { pointer, world } = this;
    if (!this.pointed) {
      this.pointed = true;
      const number = pointer ? this.stage.numberAt(pointer.x, pointer.y) : 0;
      const found = this.stage.batches.elementAt(number);
      this.panel.readout(found && world?.facts(found.cluster, found.k), pointer?.x ?? 0, pointer?.y ?? 0);
    }
    requestAnimationFrame(() => this.point());
  }

  private listen(): void {
    const scene = part<HTMLCanvasElement>("scene");
    scene.addEventListener("pointermove", ({ offsetX: x, offsetY: y, buttons }) => {
      this.pointer = buttons === 0 ? { x, y } : null;
      this.pointed = false;
    });
    scene.addEventListener("pointerdown", ({ offsetX: x, offsetY: y, pointerType }) => {
      this.pointer = pointerType === "mouse" ? null : { x, y };
      this.pointed = false;
    });
    scene.addEventListener("pointerleave", ({ pointerType }) => {
      if (pointerType !== "mouse") return;
      this.pointer = null;
      this.pointed = false;
    });
    this.point();

    for (const id of ["quantity", "auto", "tone", "ambient", "patches", "elements-wires"]) {
      part(id).addEventListener("change", () => this.apply());
    }
    part("exposure").addEventListener("input", () => {
      part<HTMLInputElement>("auto").checked = false;
      this.apply();
    });
    part("camera").addEventListener("change", () => this.take(Number(part<HTMLSelectElement>("camera").value)));
    for (const input of document.querySelectorAll<HTMLInputElement>("input[name=way]")) {
      input.addEventListener("change", () => (this.stage.navigation.way = input.value as Way));
    }
    part("pause").addEventListener("click", () => this.connection.say(this.panel.paused ? "resume" : "pause"));
    part("stop").addEventListener("click", () => {
      // A solver that waits hears it, too.
      this.connection.say("stop");
      part<HTMLButtonElement>("stop").disabled = true;
    });
    part("save-picture").addEventListener("click", async () => save(await this.stage.picture(), `${this.name}.png`));
    part("save-model").addEventListener("click", () => void this.saveModel());
    part("open-panel").addEventListener("click", () => togglePanel());
    part("open-help").addEventListener("click", () => part<HTMLDialogElement>("help").showModal());
    part("theme").addEventListener("click", toggleTheme);
    document.addEventListener("keydown", (event) => this.key(event));
    if (innerWidth <= 640) togglePanel();
  }

  private get name(): string {
    return this.world?.hello.name.replace(/\.[^.]*$/, "") || "scene";
  }

  private take(camera: number): void {
    const found = this.world?.hello.cameras[camera];
    if (found) this.stage.navigation.take(found);
  }

  private async saveModel(): Promise<void> {
    const button = part<HTMLButtonElement>("save-model");
    button.disabled = true;
    try {
      const response = await fetch("model.glb" + location.search);
      if (!response.ok) throw new Error(await response.text());
      save(await response.blob(), `${this.name}-lit.glb`);
    } catch (error) {
      this.panel.message(`No model: ${error instanceof Error ? error.message : String(error)}`);
      setTimeout(() => this.panel.message(""), 4000);
    } finally {
      button.disabled = false;
    }
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    const typing = target.matches("input:not([type=checkbox], [type=radio]), select") || event.ctrlKey || event.metaKey;
    if (typing || event.altKey || part<HTMLDialogElement>("help").open) return;
    const press = (id: string) => part(id).click();
    const next = (id: string) => {
      const select = part<HTMLSelectElement>(id);
      const open = [...select.options].filter((option) => !option.disabled);
      const place = open.findIndex((option) => option.selected);
      select.value = open[(place + 1) % open.length]?.value ?? "";
      select.dispatchEvent(new Event("change"));
    };
    const brighter = (stops: number) => {
      const slider = part<HTMLInputElement>("exposure");
      slider.value = String(Number(slider.value) - stops);
      slider.dispatchEvent(new Event("input"));
    };
    const way = (k: number) => document.querySelectorAll<HTMLInputElement>("input[name=way]")[k]?.click();
    const actions: Record<string, () => void> = {
      "1": () => way(0),
      "2": () => way(1),
      "3": () => way(2),
      c: () => next("camera"),
      f: () => next("quantity"),
      m: () => press("ambient"),
      g: () => press("patches"),
      h: () => press("elements-wires"),
      p: () => press("open-panel"),
      t: () => press("theme"),
      "?": () => press("open-help"),
      "+": () => brighter(0.5),
      "=": () => brighter(0.5),
      "-": () => brighter(-0.5),
      "0": () => !part<HTMLInputElement>("auto").checked && press("auto"),
    };
    if (event.key === " " && !target.matches("button")) actions[" "] = () => press("pause");
    const action = actions[event.key.toLowerCase()];
    if (!action) return;
    event.preventDefault();
    action();
  }
}

function save(blob: Blob | null, name: string): void {
  if (!blob) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

function togglePanel(): void {
  const panel = part("panel");
  panel.hidden = !panel.hidden;
  part("open-panel").ariaExpanded = String(!panel.hidden);
}

function toggleTheme(): void {
  const root = document.documentElement;
  const now = root.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  root.dataset.theme = now === "dark" ? "light" : "dark";
}

new Page();
