// The curves of the energy over time: shares of the emitted power.

import type { Point } from "./protocol.js";

/** Columns of a point, what they are called, and their colours. */
const LINES = [
  { column: 2, name: "unshot", colour: "#e8912d" },
  { column: 3, name: "absorbed", colour: "#4b8fd6" },
  { column: 4, name: "by backs", colour: "#9a6dd7" },
  { column: 5, name: "escaped", colour: "#4caf7d" },
] as const;

export class CurvesView {
  private points: Point[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    key: HTMLElement,
  ) {
    for (const { name, colour } of LINES) {
      const entry = document.createElement("span");
      const patch = document.createElement("i");
      patch.style.background = colour;
      entry.append(patch, name);
      key.append(entry);
    }
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  set(points: Point[]): void {
    this.points = points;
    this.draw();
  }

  add(point: Point): void {
    const last = this.points.at(-1);
    if (last && point[0] < last[0]) this.points = [];
    this.points.push(point);
    if (this.points.length > 2000) this.points = this.points.filter((_, k) => k % 2 === 0);
    this.draw();
  }

  private draw(): void {
    const { canvas, points } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    const context = canvas.getContext("2d");
    if (!context || width === 0) return;
    context.clearRect(0, 0, width, height);
    context.strokeStyle = "#8884";
    context.lineWidth = ratio;
    for (const share of [0, 0.5, 1]) {
      const y = (1 - share) * (height - 2 * ratio) + ratio;
      context.beginPath();
      context.moveTo(0, y);
      context.lineTo(width, y);
      context.stroke();
    }
    const [begin, end] = [points[0]?.[0] ?? 0, points.at(-1)?.[0] ?? 0];
    if (end <= begin) return;
    context.lineWidth = 1.6 * ratio;
    context.lineJoin = "round";
    for (const { column, colour } of LINES) {
      context.strokeStyle = colour;
      context.beginPath();
      for (const point of points) {
        const share = point[column];
        if (share === null) continue;
        const x = ((point[0] - begin) / (end - begin)) * width;
        const y = (1 - Math.min(Math.max(share, 0), 1)) * (height - 2 * ratio) + ratio;
        context.lineTo(x, y);
      }
      context.stroke();
    }
  }
}
