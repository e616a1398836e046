// The coverage sphere of a magnetometer calibration: cells seen and not seen, the points measured, the fitted surface.
// It is drawn in the axes of the device, which lies in the middle; one unit is the strength of the field.

import {
  BufferGeometry, Color, DirectionalLight, Float32BufferAttribute, Group, HemisphereLight, LineBasicMaterial, LineDashedMaterial, LineLoop, LineSegments,
  Matrix4, Mesh, MeshBasicMaterial, MeshStandardMaterial, type Object3D, PerspectiveCamera, Points, PointsMaterial, Scene, SphereGeometry, Vector3, DoubleSide,
} from "three";
import type { Magnetometer, MagnetometerFit, Triple } from "./protocol";
import { dispose, type Drawn, label, phone } from "./scene";
import { colour } from "./theme";

/** Steps of a cell's edge: a patch of a sphere is bent. */
const FINE = 4;
/** Hard iron farther away than this, in strengths of the field, is not drawn to scale but only named. */
const FARTHEST = 2.2;

/** The corner of slice and sector as the program counts them: slices of equal height, sectors from -x about z. */
function onSphere(slice: number, slices: number, sector: number, sectors: number, radius: number): Triple {
  const z = (2 * slice) / slices - 1, angle = (sector / sectors) * 2 * Math.PI - Math.PI, across = Math.sqrt(Math.max(0, 1 - z * z));
  return [radius * across * Math.cos(angle), radius * across * Math.sin(angle), radius * z];
}

function patch(slice: number, slices: number, sector: number, sectors: number): BufferGeometry {
  const points: number[] = [];
  const at = (i: number, j: number): Triple => onSphere(slice + i / FINE, slices, sector + j / FINE, sectors, 1);
  for (let i = 0; i < FINE; i++) {
    for (let j = 0; j < FINE; j++) points.push(...at(i, j), ...at(i, j + 1), ...at(i + 1, j + 1), ...at(i, j), ...at(i + 1, j + 1), ...at(i + 1, j));
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
  geometry.computeVertexNormals();
  return geometry;
}

function border(slice: number, slices: number, sector: number, sectors: number): BufferGeometry {
  const points: number[] = [];
  const at = (i: number, j: number): void => void points.push(...onSphere(slice + i / FINE, slices, sector + j / FINE, sectors, 1.002));
  for (let k = 0; k < FINE; k++) at(0, k);
  for (let k = 0; k < FINE; k++) at(k, FINE);
  for (let k = FINE; k > 0; k--) at(FINE, k);
  for (let k = FINE; k > 0; k--) at(k, 0);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
  return geometry;
}

/** Where the unit sphere's points lie as measured, about the centre: the inverse of the calibration. */
function shape(fit: MagnetometerFit): Matrix4 {
  const [a, b, c] = fit.soft_iron;
  return new Matrix4().set(a[0], a[1], a[2], 0, b[0], b[1], b[2], 0, c[0], c[1], c[2], 0, 0, 0, 0, 1).invert();
}

export class Sphere implements Drawn {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(32, 1, 0.1, 30);
  readonly target: [number, number, number] = [0, 0, 0];
  private fixed: Object3D[] = [];
  private moving = new Group();
  private cells: { seen: Mesh; edge: LineLoop }[] = [];
  private last: Magnetometer | null = null;

  constructor() {
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(1.7, -4.1, 1.9);
    this.camera.lookAt(0, 0, 0);
    this.build();
  }

  build(): void {
    for (const object of [...this.fixed, this.moving]) {
      this.scene.remove(object);
      dispose(object);
    }
    const sun = new DirectionalLight("#ffffff", 2);
    sun.position.set(2, -3, 4);
    const body = phone("mekf", true);
    body.scale.setScalar(0.42);
    this.fixed = [new HemisphereLight("#ffffff", "#8a99a8", 1.6), sun, body];
    this.cells = [];
    this.scene.add(...this.fixed, this.moving);
    if (this.last) this.show(this.last);
  }

  private makeCells(slices: number, sectors: number): void {
    const seen = new MeshStandardMaterial({ color: colour("good"), transparent: true, opacity: 0.38, roughness: 1, side: DoubleSide, depthWrite: false });
    const edge = new LineBasicMaterial({ color: colour("muted"), transparent: true, opacity: 0.4 });
    for (let cell = 0; cell < slices * sectors; cell++) {
      const [slice, sector] = [Math.floor(cell / sectors), cell % sectors];
      const made = { seen: new Mesh(patch(slice, slices, sector, sectors), seen), edge: new LineLoop(border(slice, slices, sector, sectors), edge) };
      this.cells.push(made);
      this.scene.add(made.seen, made.edge);
      this.fixed.push(made.seen, made.edge);
    }
  }

  show(message: Magnetometer): void {
    this.last = message;
    const { coverage, fit, points } = message;
    if (coverage && !this.cells.length) this.makeCells(coverage.slices, coverage.sectors);
    coverage?.cells.forEach((seen, i) => this.cells[i] && (this.cells[i]!.seen.visible = seen));
    this.scene.remove(this.moving);
    dispose(this.moving);
    this.moving = new Group();
    if (fit) this.moving.add(surface(fit), ...hardIron(fit));
    if (fit && points?.length) this.moving.add(...measured(points, fit));
    this.scene.add(this.moving);
  }

  dispose(): void {
    for (const object of [...this.fixed, this.moving]) dispose(object);
  }
}

/** A translucent surface with its three great circles. */
function surface(fit: MagnetometerFit): Object3D {
  const group = new Group(), bent = shape(fit);
  const skin = new Mesh(new SphereGeometry(1, 40, 24), new MeshBasicMaterial({ color: colour("accent"), transparent: true, opacity: 0.1, depthWrite: false }));
  skin.geometry.applyMatrix4(bent);
  group.add(skin);
  for (let axis = 0; axis < 3; axis++) {
    const circle = Array.from({ length: 72 }, (_, k) => {
      const [c, s] = [Math.cos((k * Math.PI) / 36), Math.sin((k * Math.PI) / 36)];
      return new Vector3(...[[0, c, s], [s, 0, c], [c, s, 0]][axis]!).applyMatrix4(bent);
    });
    group.add(new LineLoop(new BufferGeometry().setFromPoints(circle), new LineBasicMaterial({ color: colour("accent") })));
  }
  return group;
}

function measured(points: Triple[], fit: MagnetometerFit): Object3D[] {
  const scaled = points.map((p) => p.map((v, i) => (v - fit.hard_iron_ut[i]!) / fit.field_strength_ut) as Triple);
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(scaled.flat(), 3));
  const cloud = new Points(geometry, new PointsMaterial({ color: new Color(colour("ink")), size: 0.05 }));
  // The first is the newest: the field as the device sees it now.
  const [x, y, z] = scaled[0]!;
  const now = new Mesh(new SphereGeometry(0.055, 16, 12), new MeshBasicMaterial({ color: colour("ink") }));
  now.position.set(x, y, z);
  const line = new BufferGeometry();
  line.setAttribute("position", new Float32BufferAttribute([0, 0, 0, x, y, z], 3));
  return [cloud, now, new LineSegments(line, new LineBasicMaterial({ color: colour("ink") }))];
}

/** From where no field would be measured to the centre of the surface: the hard iron. */
function hardIron(fit: MagnetometerFit): Object3D[] {
  const zero = new Vector3(...fit.hard_iron_ut).multiplyScalar(-1 / fit.field_strength_ut);
  if (zero.length() > FARTHEST || zero.length() < 0.03) return [];
  const geometry = new BufferGeometry().setFromPoints([zero, new Vector3()]);
  const line = new LineSegments(geometry, new LineDashedMaterial({ color: colour("ink"), dashSize: 0.05, gapSize: 0.035 }));
  line.computeLineDistances();
  const mark = new Mesh(new SphereGeometry(0.035, 12, 10), new MeshBasicMaterial({ color: colour("ink") }));
  mark.position.copy(zero);
  const name = label("0", "ink", 0.2);
  name.position.copy(zero).add(new Vector3(0.09, 0, 0.09));
  return [line, mark, name];
}
