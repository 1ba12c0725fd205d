// Which corners of elements show the same light: those at one place on one smooth surface. The words are those of the
// library's `smooth`, whose lit models and pictures look more closely: at walls that stand on a surface, above all.

/** Cosine of 30°: surfaces that meet at less count as one. */
const CREASE = 0.866;

/** Joints by place. A joint is a place on a smooth surface. */
export class Joints {
  /** Number of joints. */
  count = 0;
  private normals = new Float32Array(3 << 16);
  /** The next joint at the same place, or −1. */
  private next = new Int32Array(1 << 16);
  /** First joints by the hash of their cell: open addressing. */
  private table: Int32Array;
  private cells: Int32Array;
  private held = 0;

  constructor(
    private readonly tolerance: number,
    expected: number,
  ) {
    let size = 1 << 12;
    while (size < 2 * expected) size *= 2;
    this.table = new Int32Array(size).fill(-1);
    this.cells = new Int32Array(3 * size);
  }

  /** The joint at a position of a surface with this normal. */
  find(x: number, y: number, z: number, nx: number, ny: number, nz: number): number {
    const t = this.tolerance;
    const [cx, cy, cz] = [Math.floor(x / t), Math.floor(y / t), Math.floor(z / t)];
    // A place near the border of a cell may have been filed in the one beside it.
    const [fx, fy, fz] = [x / t - cx, y / t - cy, z / t - cz];
    const side = (f: number) => (f < 0.25 ? -1 : f > 0.75 ? 1 : 0);
    const [sx, sy, sz] = [side(fx), side(fy), side(fz)];
    for (let dx = 0; dx <= Math.abs(sx); dx++) {
      for (let dy = 0; dy <= Math.abs(sy); dy++) {
        for (let dz = 0; dz <= Math.abs(sz); dz++) {
          const slot = this.slot(cx + dx * sx, cy + dy * sy, cz + dz * sz);
          for (let joint = this.table[slot]!; joint >= 0; joint = this.next[joint]!) {
            const n = this.normals;
            if (n[3 * joint]! * nx + n[3 * joint + 1]! * ny + n[3 * joint + 2]! * nz > CREASE) return joint;
          }
        }
      }
    }
    return this.add(cx, cy, cz, nx, ny, nz);
  }

  private add(cx: number, cy: number, cz: number, nx: number, ny: number, nz: number): number {
    if (this.count === this.next.length) this.enlarge();
    const joint = this.count++;
    this.normals.set([nx, ny, nz], 3 * joint);
    let slot = this.slot(cx, cy, cz);
    if (this.table[slot]! < 0 && 2 * ++this.held > this.table.length) {
      this.rehash();
      slot = this.slot(cx, cy, cz);
    }
    this.next[joint] = this.table[slot]!;
    this.table[slot] = joint;
    this.cells.set([cx, cy, cz], 3 * slot);
    return joint;
  }

  /** The place of a cell in the table: where it is, or where it is to be. */
  private slot(cx: number, cy: number, cz: number): number {
    const mask = this.table.length - 1;
    let hash = Math.imul(cx, 0x9e3779b1) ^ Math.imul(cy, 0x85ebca77) ^ Math.imul(cz, 0xc2b2ae3d);
    hash = Math.imul(hash ^ (hash >>> 15), 0x2c1b3c6d);
    let slot = (hash ^ (hash >>> 13)) & mask;
    const c = this.cells;
    while (this.table[slot]! >= 0 && !(c[3 * slot] === cx && c[3 * slot + 1] === cy && c[3 * slot + 2] === cz)) {
      slot = (slot + 1) & mask;
    }
    return slot;
  }

  private enlarge(): void {
    const next = new Int32Array(2 * this.next.length);
    next.set(this.next);
    this.next = next;
    const normals = new Float32Array(2 * this.normals.length);
    normals.set(this.normals);
    this.normals = normals;
  }

  private rehash(): void {
    const [table, cells] = [this.table, this.cells];
    this.table = new Int32Array(2 * table.length).fill(-1);
    this.cells = new Int32Array(2 * cells.length);
    for (let old = 0; old < table.length; old++) {
      if (table[old]! < 0) continue;
      const cell = cells.subarray(3 * old, 3 * old + 3);
      const slot = this.slot(cell[0]!, cell[1]!, cell[2]!);
      this.table[slot] = table[old]!;
      this.cells.set(cell, 3 * slot);
    }
  }
}
