// The page's side of the protocol, held to what the server sends: crates/ringlight-view/tests/fixture.rs writes it.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { COVERED, ProtocolError, readRecords, type Hello, type Words } from "../src/protocol.js";
import { World } from "../src/world.js";

/** The messages of the round. */
function round(): (string | ArrayBuffer)[] {
  const bytes = readFileSync("tests/round.bin");
  const messages: (string | ArrayBuffer)[] = [];
  for (let at = 0; at < bytes.length; ) {
    const [kind, length] = [bytes[at]!, bytes.readUInt32LE(at + 1)];
    const content = bytes.subarray(at + 5, (at += 5 + length));
    messages.push(kind === 0 ? content.toString() : Uint8Array.from(content).buffer);
  }
  return messages;
}

/** The world after the round, and what else was said. */
function shown(): { world: World; words: Words[] } {
  const words: Words[] = [];
  let world: World | undefined;
  for (const message of round()) {
    if (typeof message === "string") {
      const word = JSON.parse(message) as Words;
      if ("hello" in word) world = new World(word.hello);
      words.push(word);
    } else if (message.byteLength > 0) {
      const records = readRecords(message, world!.hello, (cluster) => world!.elementCount(cluster));
      if ("geometry" in records) records.geometry.forEach((geometry) => world!.reshape(geometry));
      else if ("light" in records) records.light.forEach((light) => world!.take(light));
      else world!.places = records.places;
    }
  }
  world!.weld();
  return { world: world!, words };
}

/** All elements: their clusters and their numbers in them. */
function* elements(world: World): Generator<[number, number]> {
  for (const [number, cluster] of world.clusters.entries()) {
    for (let k = 0; k < cluster!.borders.length; k++) yield [number, k];
  }
}

function near(found: number, expected: number): void {
  assert.ok(Math.abs(found / expected - 1) < 1e-3, `${found} for ${expected}`);
}

test("a round holds the scene, how far the solver is, and the end", () => {
  const messages = round();
  const { words } = shown();
  assert.equal((messages.at(-1) as ArrayBuffer).byteLength, 0);
  assert.deepEqual(words.map((word) => Object.keys(word)[0]), ["hello", "curves", "status"]);
  const [{ hello }, , { status }] = words as [{ hello: Hello }, unknown, Extract<Words, { status: unknown }>];
  assert.equal(hello.name, "scene");
  assert.equal(hello.cameras[0]!.name, "eye");
  assert.equal(status.shots, 12);
  assert.deepEqual(status.ranks, Array(3).fill({ busy: 0.5, wait: 0.25 }));
  assert.equal(status.time_left, null);
});

test("every element has the light, colour and place that it was given", () => {
  const { world } = shown();
  const seen = new Set<number>();
  for (const [cluster, k] of elements(world)) {
    const facts = world.facts(cluster, k)!;
    const n = facts.element;
    seen.add(n);
    const covered = (world.clusters[cluster]!.borders[k]! & COVERED) !== 0;
    if (covered) {
      assert.ok(Number.isNaN(facts.irradiance[0]));
    } else {
      near(facts.irradiance[0], n + 1);
      near(facts.irradiance[1], (n + 1) / 2);
      near(facts.irradiance[2], 1e5 + 100 * n);
    }
    if (facts.object === "lamp") {
      [100, 200, 300].forEach((radiance, c) => near(facts.exitance[c]!, Math.PI * radiance));
      facts.reflectance.forEach((reflectance) => near(reflectance, 0.1));
    } else {
      [0.25, 0.5, 0.75].forEach((reflectance, c) => near(facts.reflectance[c]!, reflectance));
      assert.deepEqual(facts.exitance, [0, 0, 0]);
    }
    assert.equal(facts.owner, cluster % 3);
    assert.ok(facts.holder < 3);
  }
  assert.equal(seen.size, world.hello.elements);
});

test("of surfaces that lie in each other one is drawn", () => {
  const { world } = shown();
  let [whole, open] = [0, 0];
  for (const [number, k] of elements(world)) {
    if (world.facts(number, k)!.object === "lamp") continue;
    const { positions: p, corners, borders } = world.clusters[number]!;
    const at = (corner: number) => [0, 1, 2].map((axis) => p[3 * corners[4 * k + corner]! + axis]!);
    const [a, b, c, d] = [at(0), at(1), at(2), at(3)] as [number[], number[], number[], number[]];
    // Twice the area as it is seen from above.
    const above = (c[2]! - a[2]!) * (d[0]! - b[0]!) - (c[0]! - a[0]!) * (d[2]! - b[2]!);
    if (above < 0) continue;
    whole += above / 2;
    if ((borders[k]! & COVERED) === 0) open += above / 2;
  }
  // The tops of 2 m² of floor and of half a square metre of board.
  near(whole, 2.5);
  near(open, 2);
});

test("elements that meet on a smooth surface show the same light where they meet", () => {
  const { world } = shown();
  let inner = 0;
  const around = new Map<number, { values: number[]; places: Set<string> }>();
  for (const [number, k] of elements(world)) {
    const cluster = world.clusters[number]!;
    for (let corner = 4 * k; corner < 4 * k + 4; corner++) {
      const joint = cluster.joints[corner]!;
      const place = [0, 1, 2].map((axis) => cluster.positions[3 * cluster.corners[corner]! + axis]!.toFixed(4)).join();
      const entry = around.get(joint) ?? { values: [], places: new Set() };
      if (corner % 4 < 3 || joint !== cluster.joints[corner - 1]) entry.values.push(cluster.irradiance[3 * k]!);
      entry.places.add(place);
      around.set(joint, entry);
    }
  }
  for (const [joint, { values, places }] of around) {
    assert.equal(places.size, 1);
    const known = values.filter((value) => !Number.isNaN(value));
    if (known.length) near(world.light[4 * joint]!, known.reduce((a, b) => a + b) / known.length);
    if (values.length >= 4) inner++;
  }
  assert.ok(inner >= 4, `${inner} inner joints`);
});

test("textured elements know their places in their texture", () => {
  const { world } = shown();
  let textured = 0;
  for (const [number, k] of elements(world)) {
    const cluster = world.clusters[number]!;
    const { name, texture } = world.surface(number, k)!;
    assert.equal(cluster.texelsOf[k]! >= 0, name === "floor");
    if (cluster.texelsOf[k]! < 0) continue;
    textured++;
    assert.deepEqual(texture, { image: 0, wrap: ["Repeat", "Mirror"], nearest: true, factor: [1, 1, 1], cutoff: 0.5 });
    for (let corner = 0; corner < 4; corner++) {
      const [u, v] = cluster.texels.subarray(cluster.texelsOf[k]! + 2 * corner);
      const [x, , z] = cluster.positions.subarray(3 * cluster.corners[4 * k + corner]!);
      // The scene says u = x and v = −z; rows of images count down.
      assert.ok(Math.abs(u! - x!) < 1e-5 && Math.abs(v! - (1 + z!)) < 1e-5, `${u} ${v} at ${x} ${z}`);
    }
  }
  assert.equal(textured, 16);
});

test("what is cut off or not known is refused", () => {
  const { world } = shown();
  const message = round().find((message) => typeof message !== "string") as ArrayBuffer;
  const read = (bytes: ArrayBuffer) => readRecords(bytes, world.hello, () => 4);
  for (const length of [2, 5, 30, 100, message.byteLength - 4]) {
    assert.throws(() => read(message.slice(0, length)), (error) => error instanceof ProtocolError || error instanceof RangeError);
  }
  assert.throws(() => read(new Uint32Array([77]).buffer), ProtocolError);
});

test("new light changes only the joints of its cluster", () => {
  const { world } = shown();
  const before = world.light.slice();
  const irradiance = new Float32Array(3 * world.elementCount(0)).fill(7);
  world.take({ cluster: 0, irradiance });
  const rows = world.relight([0]);
  assert.deepEqual(rows, [[0, 0]]);
  const own = new Set(world.clusters[0]!.joints);
  for (let joint = 0; joint < world.jointCount; joint++) {
    if (!own.has(joint)) assert.equal(world.light[4 * joint], before[4 * joint]);
  }
});
