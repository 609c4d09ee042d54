// Panes: a canvas each, with the view that it is looked at through.  The models of all results turn together.
import * as THREE from "three";

const TURN = 0.008, STEP = Math.PI / 24, CLOSER = 1.15;
const clamp = THREE.MathUtils.clamp;

/** Around the unit ball, y or z up as the eye is set: turned by azimuth and elevation, moved, and come closer. */
export class Orbit {
  constructor() { this.reset(); }

  reset() { Object.assign(this, { azimuth: 0.6, elevation: 0.35, distance: 3.4, target: new THREE.Vector3() }); }

  direction() {
    const flat = Math.cos(this.elevation);
    return new THREE.Vector3(flat * Math.sin(this.azimuth), Math.sin(this.elevation), flat * Math.cos(this.azimuth));
  }

  camera() {
    const camera = new THREE.PerspectiveCamera(36, 1, 0.01, 20);
    camera.position.copy(this.target).addScaledVector(this.direction(), this.distance);
    camera.lookAt(this.target);
    camera.updateMatrixWorld();
    return camera;
  }

  drag(right, down, moving) {
    if (!moving) {
      this.azimuth -= right * TURN;
      this.elevation = clamp(this.elevation + down * TURN, -1.55, 1.55);
      return;
    }
    const { elements } = this.camera().matrixWorld, share = this.distance / 900;
    this.target.addScaledVector(new THREE.Vector3(...elements.slice(0, 3)), -right * share);
    this.target.addScaledVector(new THREE.Vector3(...elements.slice(4, 7)), down * share);
  }

  zoom(steps) { this.distance = clamp(this.distance * CLOSER ** -steps, 0.05, 12); }

  arrow(right, up) { this.azimuth += right * STEP; this.elevation = clamp(this.elevation + up * STEP, -1.55, 1.55); }

  /** Look at a place from the side that its face is on. */
  face(point, normal) {
    this.target.copy(point);
    this.elevation = Math.asin(clamp(normal.y, -0.99, 0.99));
    this.azimuth = Math.atan2(normal.x, normal.z);
  }
}

/** From above the page of the layout, moved and come closer. */
export class Sheet {
  constructor(extent) { this.extent = extent; this.reset(); }

  reset() { Object.assign(this, { x: 0.5 * this.extent[0], y: 0.5 * this.extent[1], half: 0.54 }); }

  camera() {
    const { x, y, half } = this;
    const camera = new THREE.OrthographicCamera(x - half, x + half, y + half, y - half, -1, 1);
    camera.updateMatrixWorld();
    return camera;
  }

  drag(right, down, _, width) { this.x -= (right / width) * 2 * this.half; this.y += (down / width) * 2 * this.half; }

  zoom(steps) { this.half = clamp(this.half * CLOSER ** -steps, 0.001, 4); }

  arrow(right, up) { this.x += right * this.half * 0.2; this.y += up * this.half * 0.2; }

  face(point) { this.x = point.x; this.y = point.y; }
}

/** A canvas with its view: result, whether flat, and where its pixels are. */
export class Pane {
  constructor(result, flat, view, label) {
    this.canvas = document.createElement("canvas");
    Object.assign(this, { result, flat, view });
    const role = { role: "application", tabindex: "0", "aria-label": label, "aria-roledescription": flat ? "uv layout" : "3D view" };
    for (const [name, value] of Object.entries(role)) this.canvas.setAttribute(name, value);
  }

  /** Whether the canvas has a size; its pixels follow the screen's. */
  fit() {
    const { clientWidth, clientHeight } = this.canvas, side = Math.min(clientWidth, clientHeight);
    const pixels = Math.round(side * Math.min(window.devicePixelRatio, 2));
    if (pixels && this.canvas.width !== pixels) this.canvas.width = this.canvas.height = pixels;
    return pixels > 0;
  }

  /** Pixels of the canvas under a pointer.  The canvas is drawn as a square in the middle of its box. */
  pixel({ clientX, clientY }) {
    const box = this.canvas.getBoundingClientRect(), side = Math.min(box.width, box.height);
    const x = (clientX - box.left - (box.width - side) / 2) / side, y = (clientY - box.top - (box.height - side) / 2) / side;
    return [Math.floor(x * this.canvas.width), Math.floor(y * this.canvas.height)];
  }

  /** Where a point lies in pixels. */
  project(point) {
    const seen = point.clone().project(this.view.camera());
    return [(seen.x + 1) * 0.5 * this.canvas.width, (1 - seen.y) * 0.5 * this.canvas.height];
  }

  /** The ray through a pixel. */
  ray(x, y) {
    const caster = new THREE.Raycaster();
    const place = new THREE.Vector2((x / this.canvas.width) * 2 - 1, 1 - (y / this.canvas.height) * 2);
    caster.setFromCamera(place, this.view.camera());
    return caster.ray;
  }

  /** A ring at a point. */
  ring(point, color) {
    const context = this.canvas.getContext("2d"), [x, y] = this.project(point);
    const radius = 7 * Math.min(window.devicePixelRatio, 2);
    for (const [width, style] of [[radius * 0.6, "#0008"], [radius * 0.3, color]]) {
      context.beginPath();
      context.lineWidth = width;
      context.strokeStyle = style;
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}
