// The 3-D view: the device as the estimate turns it, ghosts of the other attitudes, a second device beside it; compass rose and horizon.

import {
  BoxGeometry, CanvasTexture, CircleGeometry, DirectionalLight, DoubleSide, EdgesGeometry, Group, HemisphereLight, LineBasicMaterial, LineSegments,
  BufferGeometry, Float32BufferAttribute, Mesh, MeshBasicMaterial, MeshStandardMaterial, type Object3D, PerspectiveCamera, PlaneGeometry, Scene, Sprite, SpriteMaterial, SRGBColorSpace, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { onLanguage } from "../words/language";
import type { Quaternion } from "./protocol";
import { t } from "./t";
import { colour, onTheme, roleOf } from "./theme";

const SIZE: [number, number, number] = [0.86, 1.7, 0.1];

/** One attitude to draw: the subject is solid, the others are ghosts. */
export interface Body {
  name: string;
  solid: boolean;
  q: Quaternion;
  /** It is of the second device, which stands beside the first. */
  second?: boolean;
}

/** A texture with a text, in the colour that the style sheet means. */
function written(text: string, role: string, pixels: number, weight = 600): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const context = canvas.getContext("2d")!;
  context.font = `${weight} ${pixels}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = colour(role);
  context.fillText(text, 64, 68);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 4;
  return texture;
}

/** A name that faces the eye; `hidden` by what stands in front of it. */
export function label(text: string, role: string, size = 0.26, hidden = false): Sprite {
  const sprite = new Sprite(new SpriteMaterial({ map: written(text, role, 84), transparent: true, depthTest: hidden, depthWrite: false }));
  sprite.scale.set(size, size, 1);
  return sprite;
}

/** A text that lies on the ground, its top away from the centre. */
function painted(text: string, role: string, size: number, at: number, radius: number): Mesh {
  const material = new MeshBasicMaterial({ map: written(text, role, 54, 650), transparent: true, depthWrite: false, side: DoubleSide });
  const mesh = new Mesh(new PlaneGeometry(size, size), material);
  mesh.position.set(Math.sin(at) * radius, Math.cos(at) * radius, 0.004);
  mesh.rotation.z = -at;
  return mesh;
}

export function lines(points: number[], role: string, opacity = 1): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(points, 3));
  return new LineSegments(geometry, new LineBasicMaterial({ color: colour(role), transparent: opacity < 1, opacity }));
}

/** A phone with its screen and body axes, solid or as edges with a tint. */
export function phone(name: string, solid: boolean): Group {
  const group = new Group();
  const role = roleOf(name);
  const box = new BoxGeometry(...SIZE);
  if (solid) {
    group.add(new Mesh(box, new MeshStandardMaterial({ color: colour(role), roughness: 0.55, metalness: 0.05 })));
    const screen = new Mesh(new BoxGeometry(SIZE[0] * 0.88, SIZE[1] * 0.86, 0.012), new MeshStandardMaterial({ color: "#10202c", roughness: 0.35 }));
    screen.position.z = SIZE[2] / 2 + 0.002;
    const camera = new Mesh(new CircleGeometry(0.035, 20), new MeshBasicMaterial({ color: "#dfe8ef" }));
    camera.position.set(0, SIZE[1] * 0.465, SIZE[2] / 2 + 0.003);
    const arrow = new Mesh(new CircleGeometry(0.2, 3, Math.PI / 2), new MeshBasicMaterial({ color: colour(role) }));
    arrow.position.set(0, SIZE[1] * 0.27, SIZE[2] / 2 + 0.012);
    group.add(screen, camera, arrow, bodyAxes());
  } else {
    group.add(new Mesh(box, new MeshBasicMaterial({ color: colour(role), transparent: true, opacity: 0.1, depthWrite: false })));
    group.add(new LineSegments(new EdgesGeometry(box), new LineBasicMaterial({ color: colour(role) })));
    const [x, y, z] = [SIZE[0] / 2, SIZE[1] / 2, SIZE[2] / 2];
    group.add(lines([-x * 0.3, y * 0.7, z, 0, y * 0.9, z, 0, y * 0.9, z, x * 0.3, y * 0.7, z], role));
  }
  return group;
}

function bodyAxes(): Group {
  const group = new Group();
  const tips: [string, string, [number, number, number]][] = [["x", "x", [0.95, 0, 0]], ["y", "y", [0, 1.3, 0]], ["z", "z", [0, 0, 0.75]]];
  for (const [text, role, tip] of tips) {
    group.add(lines([0, 0, 0, ...tip], role));
    const name = label(text, role, 0.2);
    name.position.set(...(tip.map((v) => v * 1.09) as [number, number, number]));
    group.add(name);
  }
  return group;
}

const ROSE = 1.62;
/** Places on the rose by their angle clockwise from north, degrees. */
const points = (): [number, string][] => [[0, t("rose.north")], [90, t("rose.east")], [180, t("rose.south")], [270, t("rose.west")]];

function circle(radius: number, z: number, role: string, opacity = 1): LineSegments {
  const points: number[] = [];
  const at = (k: number): [number, number, number] => [radius * Math.sin((k * Math.PI) / 60), radius * Math.cos((k * Math.PI) / 60), z];
  for (let k = 0; k < 120; k++) points.push(...at(k), ...at(k + 1));
  return lines(points, role, opacity);
}

/** The ground with its compass rose: east is x, north is y, up is z; numbers are headings, clockwise from north. */
function ground(): Group {
  const group = new Group();
  const disc = new Mesh(new CircleGeometry(ROSE, 72), new MeshBasicMaterial({ color: colour("panel"), transparent: true, opacity: 0.55, depthWrite: false }));
  disc.position.z = -0.004;
  group.add(disc, circle(ROSE, 0, "muted"), circle(ROSE * 0.78, 0, "grid"));
  const ticks: number[] = [], fine: number[] = [];
  for (let deg = 0; deg < 360; deg += 10) {
    const [s, c] = [Math.sin((deg * Math.PI) / 180), Math.cos((deg * Math.PI) / 180)];
    const inner = deg % 30 ? 0.95 : 0.9;
    (deg % 30 ? fine : ticks).push(s * ROSE, c * ROSE, 0, s * ROSE * inner, c * ROSE * inner, 0);
    if (deg % 30 === 0 && deg % 90) group.add(painted(String(deg), "muted", 0.3, (deg * Math.PI) / 180, ROSE * 1.1));
  }
  for (const [deg, text] of points()) group.add(painted(text, deg ? "muted" : "ink", 0.44, (deg * Math.PI) / 180, ROSE * 1.13));
  group.add(lines(ticks, "muted"), lines(fine, "grid"));
  // The needle: a north half that is told from the south one.
  group.add(lines([0, 0, 0, 0, ROSE * 0.9, 0, 0, ROSE * 0.9, 0, -0.09, ROSE * 0.78, 0, 0, ROSE * 0.9, 0, 0.09, ROSE * 0.78, 0], "ink"), lines([0, 0, 0, 0, -ROSE * 0.9, 0], "grid"));
  group.position.z = -0.95;
  return group;
}

/** The horizon: the circle of level directions about the device, with a mark at north. */
function horizon(): Group {
  const group = new Group();
  group.add(circle(ROSE, 0, "muted", 0.55));
  const marks: number[] = [];
  for (let deg = 0; deg < 360; deg += 30) {
    const [s, c] = [Math.sin((deg * Math.PI) / 180) * ROSE, Math.cos((deg * Math.PI) / 180) * ROSE], h = deg ? 0.05 : 0.14;
    marks.push(s, c, -h, s, c, h);
  }
  group.add(lines(marks, "muted", 0.7));
  return group;
}

export function dispose(object: Object3D): void {
  object.traverse((part) => {
    const mesh = part as Mesh;
    mesh.geometry?.dispose();
    for (const material of [mesh.material].flat()) {
      (material as SpriteMaterial | undefined)?.map?.dispose();
      material?.dispose();
    }
  });
}

/** Something to draw. */
export interface Drawn {
  readonly scene: Scene;
  readonly camera: PerspectiveCamera;
  /** What the camera looks at. */
  readonly target: [number, number, number];
  /** Makes everything anew, in the colours of now. */
  build(): void;
  dispose(): void;
}

/** What is needed to draw one world: used once for the lab view, many times for the wall. */
export class World implements Drawn {
  readonly target: [number, number, number] = [0, 0, -0.36];
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(34, 1, 0.1, 30);
  private bodies = new Map<string, Group>();
  private fixed: Object3D[] = [];
  private shown: Body[] = [];

  constructor() {
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(1.75, -5.2, 3.05);
    this.camera.lookAt(...this.target);
    this.build();
  }

  /** Makes everything anew, in the colours of now. */
  build(): void {
    for (const object of this.fixed) {
      this.scene.remove(object);
      dispose(object);
    }
    const sun = new DirectionalLight("#ffffff", 2.2);
    sun.position.set(2, -3, 5);
    this.fixed = [new HemisphereLight("#ffffff", "#8a99a8", 1.5), sun, ground(), horizon()];
    this.scene.add(...this.fixed);
    for (const name of [...this.bodies.keys()]) this.remove(name);
    this.set(this.shown);
  }

  dispose(): void {
    for (const name of [...this.bodies.keys()]) this.remove(name);
    for (const object of this.fixed) dispose(object);
  }

  private remove(name: string): void {
    const body = this.bodies.get(name);
    if (!body) return;
    this.scene.remove(body);
    dispose(body);
    this.bodies.delete(name);
  }

  /** Shows these attitudes and no others. */
  set(bodies: Body[]): void {
    this.shown = bodies;
    for (const name of [...this.bodies.keys()]) if (!bodies.some((b) => key(b) === name)) this.remove(name);
    for (const body of bodies) {
      let group = this.bodies.get(key(body));
      if (!group) {
        group = phone(body.name, body.solid);
        this.bodies.set(key(body), group);
        this.scene.add(group);
      }
      const [w, x, y, z] = body.q;
      group.quaternion.set(x, y, z, w);
      // Two devices stand side by side.
      group.position.x = bodies.some((b) => b.second) ? (body.second ? 0.85 : -0.85) : 0;
    }
  }
}

const key = (body: Body): string => `${body.solid ? "solid" : "ghost"} ${body.second ? "second" : ""} ${body.name}`;

/** The view angle that shows the whole rose, also where the canvas is narrower than high. */
const FIELD_DEG = 34;
function fit(camera: PerspectiveCamera, aspect: number): void {
  camera.aspect = aspect;
  const half = Math.tan((FIELD_DEG * Math.PI) / 360);
  camera.fov = 2 * Math.atan(Math.max(half, (half * 1.18) / aspect)) * (180 / Math.PI);
  camera.updateProjectionMatrix();
}

/** Draws worlds on one canvas, only when something changed. */
export class View<W extends Drawn = World> {
  private readonly renderer: WebGLRenderer;
  private controls: OrbitControls | null = null;
  private asked = 0;
  /** Ends listening for other colours and another language. */
  private stop: () => void;
  private watch: ResizeObserver;

  /** Without a world the canvas has cells with worlds of their own, which their owner disposes of. */
  constructor(private readonly canvas: HTMLCanvasElement, readonly world: W | null, private readonly cells?: () => { world: World; box: DOMRect }[]) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    if (world) {
      this.controls = new OrbitControls(world.camera, canvas);
      this.controls.target.set(...world.target);
      this.controls.enablePan = false;
      this.controls.minDistance = 3;
      this.controls.maxDistance = 14;
      this.controls.addEventListener("change", () => this.ask());
    }
    const again = (): void => {
      this.world?.build();
      for (const cell of this.cells?.() ?? []) cell.world.build();
      this.ask();
    };
    const stops = [onTheme(again), onLanguage(again)];
    this.stop = () => stops.forEach((stop) => stop());
    this.watch = new ResizeObserver(() => this.ask());
    this.watch.observe(canvas);
  }

  /** Draws at the next chance. */
  ask(): void {
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      this.draw();
    });
  }

  private draw(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    if (this.world) {
      fit(this.world.camera, width / height);
      this.renderer.render(this.world.scene, this.world.camera);
      return;
    }
    const origin = this.canvas.getBoundingClientRect();
    this.renderer.setScissorTest(true);
    this.renderer.clear();
    for (const { world, box } of this.cells?.() ?? []) {
      const left = box.left - origin.left, bottom = origin.bottom - box.bottom;
      if (box.bottom < origin.top || box.top > origin.bottom) continue;
      this.renderer.setViewport(left, bottom, box.width, box.height);
      this.renderer.setScissor(left, bottom, box.width, box.height);
      fit(world.camera, box.width / box.height);
      this.renderer.render(world.scene, world.camera);
    }
  }

  close(): void {
    cancelAnimationFrame(this.asked);
    this.stop();
    this.watch.disconnect();
    this.controls?.dispose();
    this.world?.dispose();
    this.renderer.dispose();
  }
}
