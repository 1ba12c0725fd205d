// Numbers in words.

/** A number with three digits that count, and a unit. */
export function measure(value: number, unit: string): string {
  if (!Number.isFinite(value)) return "–";
  return `${digits(value)} ${unit}`;
}

/** A number with three digits that count. */
export function digits(value: number): string {
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e6 || size < 1e-3) return value.toExponential(2);
  return value.toLocaleString("en", { maximumSignificantDigits: size >= 1000 ? 4 : 3, useGrouping: false });
}

/** A count with a prefix. */
export function count(value: number): string {
  for (const [power, prefix] of [[1e9, " G"], [1e6, " M"], [1e4, " k"]] as const) {
    if (value >= power) return `${(value / (prefix === " k" ? 1e3 : power)).toPrecision(3)}${prefix}`;
  }
  return value.toFixed(0);
}

/** Seconds in words. */
export function duration(seconds: number): string {
  if (seconds < 60) return `${seconds.toFixed(0)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ${Math.floor(seconds % 60)} s`;
  if (seconds < 172800) return `${(seconds / 3600).toFixed(1)} h`;
  return `${(seconds / 86400).toFixed(1)} days`;
}

/** A share as per cent. */
export function percent(share: number): string {
  return `${(100 * share).toPrecision(3)} %`;
}
