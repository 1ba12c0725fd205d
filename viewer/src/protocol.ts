// What the server says: crates/ringlight-view/README.md describes it. Nothing here draws.

/** The version of the protocol that this page speaks. */
export const VERSION = 1;

export type Rgb = [number, number, number];

export interface Camera {
  name: string;
  /** Camera-to-scene transformation: four columns. */
  matrix: number[][];
  /** Vertical, radians; 0 for an orthographic camera. */
  field_of_view: number;
  half_height: number;
}

export type Wrap = "Repeat" | "Mirror" | "Clamp";

export interface Texture {
  /** Number of the image. */
  image: number;
  wrap: [Wrap, Wrap];
  nearest: boolean;
  /** What texels are multiplied with. */
  factor: Rgb;
  /** Alpha below which nothing is there. */
  cutoff: number;
}

export interface Surface {
  name: string;
  texture: Texture | null;
}

export interface Hello {
  protocol: number;
  version: string;
  name: string;
  photometric: boolean;
  live: boolean;
  clusters: number;
  patches: number;
  elements: number;
  ranks: number;
  until: number;
  origin: Rgb;
  bounds: [Rgb, Rgb];
  surfaces: Surface[];
  cameras: Camera[];
  sky: Rgb;
}

export interface Energy {
  emitted: number;
  absorbed: number;
  absorbed_by_backs: number;
  escaped: number;
  unshot: number;
  closure_error: number;
}

export interface Status {
  phase: "solve" | "pause" | "write" | "done";
  ended: string | null;
  seconds: number;
  shots: number;
  unshot_share: number;
  rays: number;
  rays_per_second: number;
  time_left: number | null;
  energy: Energy | null;
  ambient: Rgb;
  ranks: { busy: number; wait: number }[];
}

/** Seconds, shots, and shares of the emitted power: unshot, absorbed, absorbed by backs, escaped; null if not yet known. */
export type Point = [number, number, number, number | null, number | null, number | null];

export interface Curves {
  points: Point[];
}

export type Words = { hello: Hello } | { status: Status } | { curves: Curves };

/** The geometry of a cluster. */
export interface Geometry {
  cluster: number;
  firstPatch: number;
  firstElement: number;
  /** Metres, three numbers for each vertex. */
  positions: Float32Array;
  /** Of each patch: its surface, number of elements, and 1 if it has places in its texture. */
  patches: Uint32Array;
  /** Places in their texture of the corners of elements of patches that have them: eight numbers for each element. */
  texels: Float32Array;
  /** Elements of the cluster that emit, with their exitance. */
  emission: Map<number, Rgb>;
  /** Vertices of each element: four; a triangle repeats its third. */
  corners: Uint16Array | Uint32Array;
  /** Reflectance and coverage of each element, 65535 for 1. */
  colours: Uint16Array;
  /** Which edges of each element are edges of its patch; and [`COVERED`]. */
  borders: Uint8Array;
}

/** The light of a cluster. */
export interface Light {
  cluster: number;
  /** Irradiance, three numbers for each element; not a number where it is covered. */
  irradiance: Float32Array;
}

/** Who owns each cluster, and who holds the geometry of each patch. */
export interface Places {
  owners: Uint16Array;
  holders: Uint16Array;
}

export type Records = { geometry: Geometry[] } | { light: Light[] } | { places: Places };

/** What was sent makes no sense. */
export class ProtocolError extends Error {}

/** Reads numbers one after the other, each kind of them aligned as the records are: to four bytes. */
class Reader {
  private at = 0;
  constructor(private readonly bytes: ArrayBuffer) {}

  get done(): boolean {
    return this.at >= this.bytes.byteLength;
  }

  private take(length: number): number {
    const start = this.at;
    this.at += length;
    if (this.at > this.bytes.byteLength) throw new ProtocolError("a record is cut off");
    return start;
  }

  u32(): number {
    return new DataView(this.bytes).getUint32(this.take(4), true);
  }

  f32(): number {
    return new DataView(this.bytes).getFloat32(this.take(4), true);
  }

  f32s(count: number): Float32Array {
    return new Float32Array(this.bytes, this.take(4 * count), count);
  }

  u32s(count: number): Uint32Array {
    return new Uint32Array(this.bytes, this.take(4 * count), count);
  }

  u16s(count: number): Uint16Array {
    return new Uint16Array(this.bytes, this.take(2 * count), count);
  }

  u8s(count: number): Uint8Array {
    return new Uint8Array(this.bytes, this.take(count), count);
  }

  align(): void {
    this.at = (this.at + 3) & ~3;
  }
}

/** Bit of an element's borders: other geometry covers it, and it is not drawn. */
export const COVERED = 128;

const GEOMETRY = 1;
const LIGHT = 2;
const PLACES = 3;

/** Reads a binary message. `elements` tells how many elements a cluster has. */
export function readRecords(bytes: ArrayBuffer, hello: Hello, elements: (cluster: number) => number): Records {
  const reader = new Reader(bytes);
  const kind = reader.u32();
  switch (kind) {
    case GEOMETRY: {
      const geometry = [];
      while (!reader.done) geometry.push(readGeometry(reader));
      return { geometry };
    }
    case LIGHT: {
      const light = [];
      while (!reader.done) light.push(readLight(reader, elements));
      return { light };
    }
    case PLACES:
      return { places: { owners: reader.u16s(hello.clusters), holders: reader.u16s(hello.patches) } };
    default:
      throw new ProtocolError(`records of kind ${kind} are not known`);
  }
}

function readGeometry(reader: Reader): Geometry {
  const [cluster, firstPatch, firstElement, patchCount, vertexCount, count, emitting] = [1, 2, 3, 4, 5, 6, 7].map(() =>
    reader.u32(),
  ) as [number, number, number, number, number, number, number];
  const positions = reader.f32s(3 * vertexCount);
  const patches = reader.u32s(3 * patchCount);
  let textured = 0;
  for (let patch = 0; patch < patchCount; patch++) if (patches[3 * patch + 2]) textured += patches[3 * patch + 1]!;
  const texels = reader.f32s(8 * textured);
  const emission = new Map<number, Rgb>();
  for (let k = 0; k < emitting; k++) emission.set(reader.u32(), [reader.f32(), reader.f32(), reader.f32()]);
  const corners = vertexCount < 65536 ? reader.u16s(4 * count) : reader.u32s(4 * count);
  const colours = reader.u16s(4 * count);
  const borders = reader.u8s(count);
  reader.align();
  return { cluster, firstPatch, firstElement, positions, patches, texels, emission, corners, colours, borders };
}

function readLight(reader: Reader, elements: (cluster: number) => number): Light {
  const cluster = reader.u32();
  const unit = reader.f32();
  const halves = reader.u16s(3 * elements(cluster));
  reader.align();
  const irradiance = new Float32Array(halves.length);
  for (let k = 0; k < halves.length; k++) irradiance[k] = HALVES[halves[k]!]! * unit;
  return { cluster, irradiance };
}

/** The values of all half floats. */
const HALVES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const sign = bits >> 15 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : (2 ** -14 * fraction) / 1024);
});
