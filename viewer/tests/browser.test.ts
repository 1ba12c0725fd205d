// The page in a browser, beside a real bake. `RINGLIGHT` is the command; with `RINGLIGHT_MPI=1` it was built for MPI.
// Pictures of failures are kept in `build/failures`.

import assert from "node:assert/strict";
import { spawn, type ChildProcess } from "node:child_process";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, join } from "node:path";
import { after, before, test, type TestContext } from "node:test";
import { setTimeout as sleep } from "node:timers/promises";
import { chromium, type Browser, type Page } from "playwright-core";

const COMMAND = process.env.RINGLIGHT ?? "../target/release/ringlight";
const OFFICE = "../scenes/office.glb";
const FOLDERS = (process.env.PATH ?? "").split(delimiter);
const CHROMIUM = ["chromium", "chromium-browser", "google-chrome"].flatMap((name) => FOLDERS.map((at) => join(at, name)));
/** A bake of many small shots that goes on until it is stopped. */
const SLOW = ["bake", OFFICE, "--element-size", "0.1", "--cells", "64", "--until", "0"];
/** Longest wait for anything, milliseconds: software draws slowly beside a bake. */
const PATIENCE = 60_000;

/** A command that shows something. */
class Run {
  private words = "";
  readonly ended: Promise<number | null>;

  private constructor(private readonly child: ChildProcess) {
    child.stderr!.on("data", (data: Buffer) => (this.words += data.toString()));
    this.ended = new Promise((resolve) => child.on("exit", resolve));
  }

  static async start(words: string[], ranks = 1): Promise<[Run, string]> {
    const launcher = process.env.MPIRUN ?? "mpirun";
    const env = {
      ...process.env,
      OMPI_ALLOW_RUN_AS_ROOT: "1",
      OMPI_ALLOW_RUN_AS_ROOT_CONFIRM: "1",
      OMPI_MCA_rmaps_base_oversubscribe: "1",
      OMPI_MCA_mpi_yield_when_idle: "1",
    };
    const [program, ...first] = ranks > 1 ? [launcher, "-n", String(ranks), COMMAND] : [COMMAND];
    const run = new Run(spawn(program!, [...first, ...words], { stdio: ["ignore", "ignore", "pipe"], env }));
    const link = await until("the link", () => /view: (http:\S+)/.exec(run.words)?.[1]);
    return [run, link];
  }

  get said(): string {
    return this.words;
  }

  stop(): void {
    this.child.kill("SIGKILL");
  }
}

/** Waits until something is there. */
async function until<T>(what: string, get: () => T | undefined | null | false | Promise<T | undefined | null | false>): Promise<T> {
  for (const start = Date.now(); Date.now() - start < PATIENCE; await sleep(100)) {
    const found = await get();
    if (found) return found;
  }
  throw new Error(`waited in vain for ${what}`);
}

let browser: Browser;
let folder: string;

before(async () => {
  const executablePath = CHROMIUM.find(existsSync);
  assert.ok(executablePath, "there is no Chromium");
  const args = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
  if (process.getuid?.() === 0) args.push("--no-sandbox");
  browser = await chromium.launch({ executablePath, args });
  folder = mkdtempSync(join(tmpdir(), "ringlight-view-"));
});

after(async () => {
  await browser.close();
  rmSync(folder, { recursive: true });
});

/** Opens a page; all that it asks for has to come from the server. */
async function open(link: string): Promise<Page> {
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  page.setDefaultTimeout(PATIENCE);
  const host = new URL(link).host;
  page.on("request", (request) => {
    const url = new URL(request.url());
    const own = url.host === host || url.protocol === "data:" || url.protocol === "blob:";
    if (!own) page.evaluate((text) => document.body.setAttribute("data-strange", text), request.url());
  });
  const error = (text: string) => page.evaluate((text) => document.body.setAttribute("data-error", text), text);
  page.on("pageerror", (found) => error(String(found)));
  page.on("console", (message) => {
    // A server that has ended is no error of the page.
    if (message.type() === "error" && !message.text().includes("ERR_CONNECTION")) void error(message.text());
  });
  await page.goto(link);
  await page.evaluate(() => document.getElementById("panel")!.setAttribute("hidden", ""));
  return page;
}

/** Does something with a run and a page, and keeps a picture if it fails. */
async function watched(
  t: TestContext,
  words: string[],
  ranks: number,
  body: (page: Page, run: Run, link: string) => Promise<void>,
): Promise<void> {
  const [run, link] = await Run.start(words, ranks);
  let page: Page | undefined;
  try {
    page = await open(link);
    await body(page, run, link);
    assert.equal(await page.getAttribute("body", "data-error"), null);
    assert.equal(await page.getAttribute("body", "data-strange"), null);
  } catch (error) {
    mkdirSync("build/failures", { recursive: true });
    await page?.screenshot({ path: `build/failures/${t.name.replaceAll(/\W+/g, "-")}.png` });
    console.error(run.said);
    throw error;
  } finally {
    run.stop();
    await page?.close();
  }
}

async function data(page: Page, name: string): Promise<number> {
  return Number(await page.getAttribute("body", `data-${name}`));
}

/** The mean of what the canvas shows, 0 to 255, of a part of it without panels. */
async function brightness(page: Page): Promise<number> {
  const png = await page.locator("#scene").screenshot();
  return page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d")!;
    context.drawImage(bitmap, 0, 0);
    const pixels = context.getImageData(0, 60, bitmap.width, bitmap.height - 60).data;
    return pixels.reduce((sum, x, k) => (k % 4 < 3 ? sum + x : sum), 0) / (pixels.length * 0.75);
  }, png.toString("base64"));
}

/** Sets an input of the panel, which is hidden. */
async function set(page: Page, id: string, value: string | boolean): Promise<void> {
  await page.evaluate(([id, value]) => {
    const input = document.getElementById(id as string) as HTMLInputElement;
    if (typeof value === "boolean") input.checked = value;
    else input.value = value!;
    input.dispatchEvent(new Event(input.type === "range" ? "input" : "change"));
  }, [id, value] as const);
}

async function press(page: Page, id: string): Promise<void> {
  await page.evaluate((id) => document.getElementById(id)!.click(), id);
}

/**
 * Light arrives, waits, goes on, gets brighter, and is told as the table has it.
 *
 * The bake waits from the first light on until all that shows only while it waits was looked at, so that however fast
 * it is, most of its light is still to come when more is waited for.
 */
async function see(page: Page, run: Run, table: string, link: string, paused = async () => {}): Promise<void> {
  await until("the first light", async () => (await data(page, "shots")) > 0 && (await data(page, "updates")) > 1);
  await press(page, "pause");
  await until("the pause", async () => (await page.getAttribute("body", "data-phase")) === "pause");
  await sleep(600);
  const shots = await data(page, "shots");
  await sleep(1500);
  assert.equal(await data(page, "shots"), shots);

  // A fixed exposure, so that more light is more brightness.
  await set(page, "ambient", false);
  await set(page, "exposure", "7");
  const dark = await brightness(page);
  await set(page, "exposure", "5");
  await until("a brighter picture", async () => (await brightness(page)) > dark * 1.1);
  await set(page, "exposure", "9");
  await until("a darker picture", async () => (await brightness(page)) < dark * 0.9);
  await set(page, "exposure", "7");
  await paused();

  // Who comes late sees the same, also while nothing happens.
  const late = await open(link);
  await until("the state for a late page", async () => (await data(late, "shots")) === shots);
  await late.close();

  await press(page, "pause");
  await until("more light", async () => (await brightness(page)) > dark + 1);
  await press(page, "stop");
  assert.equal(await run.ended, 4, run.said);

  // The table is that of the last state, which the page keeps.
  await until("the end", async () => /stopped|ended|lost/.test((await page.textContent("#phase")) ?? ""));
  const rows = readFileSync(table, "utf8").trim().split("\n").slice(1).map((row) => row.split(","));
  let compared = 0;
  for (const [x, y] of [[100, 300], [320, 240], [200, 400], [400, 430], [330, 110], [560, 350], [480, 200]] as const) {
    await page.mouse.move(x, y);
    await sleep(400);
    const { element, irradiance } = await page.evaluate(() => ({ ...document.getElementById("readout")!.dataset }));
    const row = rows[Number(element)];
    if (!element || !row || irradiance === "NaN") continue;
    // Names may hold commas: the last columns are counted from the end.
    const expected = Number(row.at(-3));
    assert.equal(row[0], element);
    assert.ok(Math.abs(Number(irradiance) - expected) <= 2e-3 * expected, `${element}: ${irradiance} for ${expected}`);
    compared++;
  }
  assert.ok(compared >= 4, `${compared} values under the pointer`);
}

test("a bake is watched, paused, stopped and saved", { timeout: 5 * PATIENCE }, async (t) => {
  const table = join(folder, "one.csv");
  const words = [...SLOW, "-o", table, "--view", "--threads", "1"];
  await watched(t, words, 1, (page, run, link) => see(page, run, table, link));
});

const mpi = process.env.RINGLIGHT_MPI === "1";
test("a bake on three MPI ranks is watched in the same way", { timeout: 5 * PATIENCE, skip: !mpi && "built without MPI" }, async (t) => {
  const table = join(folder, "three.csv");
  const words = [...SLOW, "-o", table, "--view", "--threads", "1"];
  await watched(t, words, 3, async (page, run, link) => {
    await see(page, run, table, link, async () => {
      await set(page, "quantity", "owners");
      const owners = await brightness(page);
      await set(page, "quantity", "holders");
      await until("another picture", async () => Math.abs((await brightness(page)) - owners) > 0.5);
      assert.equal(await page.locator("#loads > div").count(), 3);
      await set(page, "quantity", "light");
    });
  });
});

test("a page finds the server again, and downloads the model and a picture", { timeout: 5 * PATIENCE }, async (t) => {
  const solution = join(folder, "box.ringlight");
  const words = ["bake", "../scenes/cornell_box.obj", "--quality", "draft", "--until", "0.05", "-o", solution, "--view"];
  const [bake] = await Run.start(words);
  assert.equal(await bake.ended, 0, bake.said);
  await watched(t, ["view", solution], 1, async (page, run, link) => {
    await until("the solution", async () => (await data(page, "updates")) >= 1);
    assert.equal(await page.getAttribute("body", "data-phase"), "done");
    const seen = await until("light", () => brightness(page));
    assert.ok(seen > 20, `brightness ${seen}`);
    for (const [button, name, magic] of [["save-model", "cornell_box-lit.glb", "glTF"], ["save-picture", "cornell_box.png", "PNG"]]) {
      const [download] = await Promise.all([page.waitForEvent("download"), press(page, button!)]);
      assert.equal(download.suggestedFilename(), name);
      const content = readFileSync((await download.path())!);
      assert.ok(content.subarray(0, 8).includes(magic!) && content.length > 10_000, `${name}: ${content.length} bytes`);
    }
    run.stop();
    await until("the loss", async () => (await page.textContent("#phase")) !== "done");
    const [again] = await Run.start(["view", solution, `--view=127.0.0.1:${new URL(link).port}`]);
    try {
      await until("the server again", async () => (await page.textContent("#phase")) === "done");
    } finally {
      again.stop();
    }
  });
});

test("false colour, edges, keys and small screens", { timeout: 5 * PATIENCE }, async (t) => {
  await watched(t, ["view", "../scenes/cornell_box.obj", "--quality", "draft"], 1, async (page) => {
    await until("the solution", async () => (await page.getAttribute("body", "data-phase")) === "done");
    await page.focus("#scene");
    const light = await brightness(page);
    await page.keyboard.press("f");
    await until("the legend", () => page.isVisible("#legend"));
    assert.equal(await page.textContent("#legend-unit"), "W/m²");
    assert.ok((await page.locator("#legend-marks span").count()) >= 4);
    assert.notEqual(await brightness(page), light);
    await page.keyboard.press("f");
    await until("no legend", () => page.isHidden("#legend"));
    await page.keyboard.press("g");
    await page.keyboard.press("h");
    await until("lines", async () => Math.abs((await brightness(page)) - light) > 0.5);
    await page.keyboard.press("2");
    await page.keyboard.down("w");
    await sleep(500);
    await page.keyboard.up("w");
    await until("another view", async () => Math.abs((await brightness(page)) - light) > 1);
    await page.keyboard.press("?");
    await until("help", () => page.isVisible("#help"));
    await page.keyboard.press("Escape");
    await page.setViewportSize({ width: 360, height: 640 });
    await page.evaluate(() => document.getElementById("open-panel")!.click());
    const width = await page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(width <= 360, `${width} pixels wide`);
    assert.ok(await page.isVisible("#quantity"));
  });
});
