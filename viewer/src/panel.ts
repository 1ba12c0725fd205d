// What stands beside the scene: how far the solver is, what is shown and how, and what can be done.

import { rankColour, type Quantity } from "./material.js";
import type { Hello, Point, Status } from "./protocol.js";
import { CurvesView } from "./curves.js";
import { marks, turbo, type Scale } from "./scales.js";
import { count, digits, duration, measure, percent } from "./words.js";
import { photometric, type ElementFacts } from "./world.js";

/** An element of the page. */
export function part<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no ${id}`);
  return found as T;
}

const PHASES = { solve: "solving", pause: "paused", write: "writing", done: "done" };

const ENDS: Record<string, string> = {
  converged: "converged",
  "nothing-left": "converged",
  "max-shots": "all shots done",
  memory: "stopped: no memory for smaller elements",
  stopped: "stopped",
  "time-limit": "time is over",
  interrupted: "interrupted",
  terminated: "terminated",
};

export class Panel {
  readonly curves = new CurvesView(part<HTMLCanvasElement>("curves"), part("curves-key"));
  private hello: Hello | null = null;
  private phase: Status["phase"] | null = null;

  get paused(): boolean {
    return this.phase === "pause";
  }

  /** Whether the server is there. */
  connected(there: boolean): void {
    if (there) return;
    const ended = this.phase === "done";
    part("phase").textContent = ended ? "ended" : "connection lost …";
    this.steer(false);
  }

  begin(hello: Hello): void {
    this.hello = hello;
    const name = hello.name || "scene";
    part("name").textContent = name;
    document.title = `${name} – Ringlight`;
    part("elements").textContent = count(hello.elements);
    part("loads").hidden = hello.ranks < 2;
    part("value-ranks").hidden = hello.ranks < 2;
    const cameras = part<HTMLSelectElement>("camera");
    const first = hello.cameras.length ? [] : [new Option("chosen", "")];
    cameras.replaceChildren(...first, ...hello.cameras.map((camera, k) => new Option(camera.name, String(k))));
    cameras.disabled = hello.cameras.length === 0;
    for (const option of part<HTMLSelectElement>("quantity").options) {
      option.disabled = hello.ranks < 2 && (option.value === "owners" || option.value === "holders");
    }
    part("ranks-key").replaceChildren(
      ...Array.from({ length: Math.min(hello.ranks, 64) }, (_, rank) => {
        const entry = document.createElement("span");
        const patch = document.createElement("i");
        patch.style.background = rankColour(rank);
        entry.append(patch, `rank ${rank}`);
        return entry;
      }),
    );
  }

  status(status: Status): void {
    const { hello } = this;
    this.phase = status.phase;
    const ended = status.ended ? ENDS[status.ended] ?? status.ended : "";
    const doing = PHASES[status.phase];
    part("phase").textContent = status.phase === "done" && ended ? ended : ended ? `${ended}, ${doing}` : doing;
    part("shots").textContent = count(status.shots);
    part("unshot").textContent = percent(status.unshot_share);
    part("rays").textContent = status.rays_per_second ? count(status.rays_per_second) : "–";
    part("seconds").textContent = status.seconds ? duration(status.seconds) : "–";
    part("left").textContent = status.time_left === null ? "–" : duration(status.time_left);
    const until = Math.max(hello?.until ?? 0, 1e-12);
    // Light dies out like a power of the work, so logarithms grow evenly.
    const done = Math.min(Math.max(Math.log(status.unshot_share) / Math.log(until), 0), 1) || 0;
    (part("progress").firstElementChild as HTMLElement).style.width = `${100 * done}%`;
    part("progress").ariaValueNow = (100 * done).toFixed(0);
    part("pause").textContent = this.paused ? "Resume" : "Pause";
    this.steer(status.phase === "solve" || status.phase === "pause");
    const { energy } = status;
    const share = (x: number | undefined) => (energy && energy.emitted > 0 && x !== undefined ? x / energy.emitted : null);
    if (status.seconds) {
      const shares = [energy?.absorbed, energy?.absorbed_by_backs, energy?.escaped].map(share);
      this.curves.add([status.seconds, status.shots, status.unshot_share, ...shares] as Point);
    }
    this.loads(status);
  }

  private steer(possible: boolean): void {
    part("steering").hidden = !(this.hello?.live ?? true);
    for (const id of ["pause", "stop"]) part<HTMLButtonElement>(id).disabled = !possible;
  }

  private loads({ ranks }: Status): void {
    if (ranks.length < 2) return;
    const most = Math.max(...ranks.map((rank) => rank.busy), 1e-9);
    part("loads").replaceChildren(
      ...ranks.map(({ busy, wait }, rank) => {
        const row = document.createElement("div");
        const bar = document.createElement("span");
        const fill = document.createElement("i");
        bar.className = "bar";
        fill.style.width = `${(100 * busy) / most}%`;
        bar.append(fill);
        const [name, value] = [document.createElement("span"), document.createElement("span")];
        name.textContent = `rank ${rank}`;
        value.textContent = `${((100 * busy) / Math.max(busy + wait, 1e-9)).toFixed(0)} %`;
        row.title = `busy ${busy.toFixed(2)} s, waiting ${wait.toFixed(2)} s`;
        row.append(name, bar, value);
        return row;
      }),
    );
  }

  /** Shows the key of what is shown. */
  key(quantity: Quantity, scale: Scale): void {
    part("legend").hidden = quantity !== "illuminance";
    part("ranks-key").hidden = quantity !== "owners" && quantity !== "holders";
    if (quantity !== "illuminance") return;
    part("legend-unit").textContent = this.unit;
    const context = part<HTMLCanvasElement>("legend-bar").getContext("2d");
    for (let y = 0; y < 256 && context; y++) {
      context.fillStyle = `rgb(${turbo(1 - y / 255).join(" ")})`;
      context.fillRect(0, y, 1, 1);
    }
    part("legend-marks").replaceChildren(
      ...marks(scale).map(([value, place]) => {
        const mark = document.createElement("span");
        mark.style.bottom = `${100 * place}%`;
        mark.textContent = digits(value);
        return mark;
      }),
    );
  }

  private get unit(): string {
    return this.hello?.photometric ?? true ? "lx" : "W/m²";
  }

  /** Shows what is known of the element at a place of the window, or nothing. */
  readout(facts: ElementFacts | undefined, x: number, y: number): void {
    const box = part("readout");
    box.hidden = !facts;
    if (!facts) return;
    const covered = Number.isNaN(facts.irradiance[0]);
    const irradiance = photometric(facts.irradiance);
    part("value-object").textContent = facts.object || `patch ${facts.patch}`;
    part("value-irradiance").textContent = covered ? "covered" : measure(irradiance, this.unit);
    const leaving = this.hello?.photometric ?? true ? "lm/m²" : "W/m²";
    part("value-radiosity").textContent = covered ? "–" : measure(photometric(facts.radiosity), leaving);
    part("value-reflectance").textContent = facts.reflectance.map((x) => x.toFixed(2)).join(" ");
    part("value-element").textContent = String(facts.element);
    part("value-rank").textContent = `${facts.owner}, geometry ${facts.holder}`;
    // In full, for scripts.
    box.dataset.element = String(facts.element);
    box.dataset.irradiance = String(irradiance);
    const [width, height] = [box.offsetWidth, box.offsetHeight];
    box.style.left = `${x + 16 + width > innerWidth ? Math.max(x - 16 - width, 4) : x + 16}px`;
    box.style.top = `${y + 16 + height > innerHeight ? Math.max(y - 16 - height, 4) : y + 16}px`;
  }

  /** Says what is in the way; nothing if nothing is. */
  message(text: string): void {
    part("message").hidden = !text;
    part("message").textContent = text;
  }
}
