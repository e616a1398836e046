// Attitudes in numbers: Euler angles of two orders, quaternion, rotation vector; angles between attitudes.
// Quaternions are w, x, y, z, body to reference, as everywhere at the program's borders.

import type { Quaternion, Triple } from "./protocol";

export const DEG = 180 / Math.PI;

/** How an attitude is written in numbers. */
export type Notation = "yaw-pitch-roll" | "alpha-beta-gamma" | "quaternion" | "rotation-vector";
export const NOTATIONS: Notation[] = ["yaw-pitch-roll", "alpha-beta-gamma", "quaternion", "rotation-vector"];

/** From here on the first and the third angle are not told apart, degrees of the second angle. */
export const GIMBAL_LOCK_DEG = 85;

const clamp = (v: number): number => Math.max(-1, Math.min(1, v));

/** Yaw, pitch, roll in degrees (Z-Y′-X″), as the program's. */
export function yawPitchRoll([w, x, y, z]: Quaternion): Triple {
  return [
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) * DEG,
    Math.asin(clamp(2 * (w * y - z * x))) * DEG,
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) * DEG,
  ];
}

/** Alpha, beta, gamma in degrees (Z-X′-Y″), the order of browsers: the second is the turn about x. */
export function alphaBetaGamma([w, x, y, z]: Quaternion): Triple {
  return [
    Math.atan2(-2 * (x * y - w * z), 1 - 2 * (x * x + z * z)) * DEG,
    Math.asin(clamp(2 * (y * z + w * x))) * DEG,
    Math.atan2(-2 * (x * z - w * y), 1 - 2 * (x * x + y * y)) * DEG,
  ];
}

/** Axis times angle, degrees. */
export function rotationVector([w, x, y, z]: Quaternion): Triple {
  const s = Math.hypot(x, y, z), angle = 2 * Math.atan2(s, Math.abs(w)) * DEG * Math.sign(w || 1);
  return s < 1e-12 ? [0, 0, 0] : [(x / s) * angle, (y / s) * angle, (z / s) * angle];
}

/** An attitude in the numbers of a notation. */
export function written(q: Quaternion, notation: Notation): number[] {
  switch (notation) {
    case "yaw-pitch-roll": return yawPitchRoll(q);
    case "alpha-beta-gamma": return alphaBetaGamma(q);
    case "rotation-vector": return rotationVector(q);
    case "quaternion": return q[0] < 0 ? q.map((v) => -v) : [...q];
  }
}

/** The angle whose approach to ±90° makes the other two one; `null` where the notation has none. */
export function middleAngle(q: Quaternion, notation: Notation): number | null {
  if (notation === "yaw-pitch-roll") return yawPitchRoll(q)[1];
  return notation === "alpha-beta-gamma" ? alphaBetaGamma(q)[1] : null;
}

/** Angle between two attitudes, degrees. */
export function angleBetween(a: readonly number[], b: readonly number[]): number {
  const dot = Math.abs(a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]! + a[3]! * b[3]!);
  // The sine is exact where the cosine is not: of small angles.
  const [w, x, y, z] = product(conjugate(a as Quaternion), b as Quaternion);
  return dot > 0.99 ? 2 * Math.atan2(Math.hypot(x, y, z), Math.abs(w)) * DEG : 2 * Math.acos(Math.min(1, dot)) * DEG;
}

export const conjugate = ([w, x, y, z]: Quaternion): Quaternion => [w, -x, -y, -z];

export const product = ([a, b, c, d]: Quaternion, [e, f, g, h]: Quaternion): Quaternion =>
  [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];

/** The turn from one attitude to another, degrees: of the vertical, and about it. */
export function tiltAndHeading(from: Quaternion, to: Quaternion): [number, number] {
  const [w, x, y, z] = product(to, conjugate(from));
  return [2 * Math.atan2(Math.hypot(x, y), Math.hypot(w, z)) * DEG, wrapped(2 * Math.atan2(z, w) * DEG)];
}

/** An angle between −180° and 180°. */
export const wrapped = (deg: number): number => deg - 360 * Math.round(deg / 360);
