// One WebGL context draws all panes: each is drawn at the canvas of the stage, then copied to a canvas of its own.
import * as THREE from "three";
import { FLIPPED, OVERLAPPING } from "data";
import { LOOKS, surfaceMaterial } from "shaders";

const SQUARE = new THREE.PlaneGeometry(1, 1).translate(0.5, 0.5, 0).toNonIndexed();

export class Stage {
  /** Throws where the browser has no WebGL 2. */
  constructor() {
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setClearAlpha(0);
    this.target = new THREE.WebGLRenderTarget(1, 1, { depthBuffer: true });
    this.props = new Map();
  }

  /** What is drawn of a result: its surface, its seams, and the square behind its layout. */
  propsOf(result) {
    if (!this.props.has(result)) {
      const material = surfaceMaterial(result), lines = new THREE.LineBasicMaterial();
      const backdrop = surfaceMaterial(result);
      Object.assign(backdrop, { transparent: true, depthWrite: false });
      backdrop.uniforms.backdrop.value = backdrop.uniforms.flattened.value = true;
      const scene = new THREE.Scene(), flat = new THREE.Scene();
      const square = new THREE.Mesh(SQUARE, backdrop);
      square.renderOrder = -1;
      scene.add(new THREE.Mesh(result.geometry, material));
      flat.add(square, new THREE.Mesh(result.geometry, material));
      const seams = new THREE.LineSegments(result.seamLines.surface, lines);
      const flatSeams = new THREE.LineSegments(result.seamLines.flat, lines);
      for (const part of [...scene.children, ...flat.children, seams, flatSeams]) part.frustumCulled = false;
      this.props.set(result, { material, backdrop, lines, scene, flat, seams, flatSeams });
    }
    return this.props.get(result);
  }

  /** Draw one pane with the settings of the page; chosen: the face pointed at, or −1. */
  draw(pane, settings, chosen) {
    const { canvas, result, flat } = pane, { width, height } = canvas;
    const props = this.propsOf(result);
    for (const { uniforms } of [props.material, props.backdrop]) setUniforms(uniforms, result, settings, chosen);
    props.material.uniforms.flattened.value = flat;
    props.material.uniformsNeedUpdate = props.backdrop.uniformsNeedUpdate = true;
    props.lines.color.setStyle(settings.seamColor, THREE.LinearSRGBColorSpace);
    this.room(width, height);
    const scene = flat ? props.flat : props.scene, camera = pane.view.camera();
    this.renderer.setViewport(0, 0, width, height);
    this.renderer.clear();
    this.renderer.render(scene, camera);
    if (settings.seams) this.drawSeams(flat ? props.flatSeams : props.seams, camera, width, height);
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    context.drawImage(this.renderer.domElement, 0, this.renderer.domElement.height - height, width, height, 0, 0, width, height);
  }

  /** Lines are a pixel wide wherever WebGL draws them: shifted by one, they are two. */
  drawSeams(seams, camera, width, height) {
    for (const [right, down] of [[0, 0], [1, 0], [0, 1], [1, 1]]) {
      camera.setViewOffset(width, height, right, down, width, height);
      this.renderer.render(seams, camera);
    }
    camera.clearViewOffset();
  }

  /** A canvas that holds the largest pane: making it anew for each would be slow. */
  room(width, height) {
    const { width: had, height: tall } = this.renderer.domElement;
    if (had < width || tall < height) this.renderer.setSize(Math.max(had, width), Math.max(tall, height), false);
    this.renderer.autoClear = false;
  }

  /** The face under a pixel of a pane, or −1: drawn as a number into a target of that one pixel. */
  faceAt(pane, x, y) {
    const { canvas, result, flat } = pane, { material, scene, flat: layout, backdrop } = this.propsOf(result);
    const camera = pane.view.camera();
    camera.setViewOffset(canvas.width, canvas.height, x, y, 1, 1);
    material.uniforms.numbered.value = true;
    material.uniforms.flattened.value = flat;
    material.uniformsNeedUpdate = true;
    backdrop.visible = false;
    this.renderer.setRenderTarget(this.target);
    this.renderer.clear();
    this.renderer.render(flat ? layout : scene, camera);
    const [low, middle, high] = this.pixel();
    this.renderer.setRenderTarget(null);
    camera.clearViewOffset();
    material.uniforms.numbered.value = false;
    backdrop.visible = true;
    return low + 256 * middle + 65536 * high - 1;
  }

  pixel() {
    const found = new Uint8Array(4);
    this.renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, found);
    return found;
  }
}

function setUniforms(uniforms, result, settings, chosen) {
  const picture = settings.pictures.get(result)?.get(settings.look);
  uniforms.look.value = LOOKS[settings.look] ?? (picture ? LOOKS.picture : LOOKS.plain);
  uniforms.picture.value = picture ?? null;
  uniforms.cells.value = (result.size ?? settings.size) / settings.cells;
  uniforms.level.value = picture ? Math.max(0, settings.level - mipsLeftOut(result, picture)) : 0;
  uniforms.marks.value = (settings.flipped ? FLIPPED : 0) | (settings.overlapping ? OVERLAPPING : 0);
  uniforms.edges.value = settings.edges;
  uniforms.chosenFace.value = chosen;
}

/** How many levels a picture of the page is below the texture it was made of. */
function mipsLeftOut(result, picture) {
  const side = Math.max(picture.image?.width ?? 1, picture.image?.height ?? 1);
  return result.size && !picture.isCard ? Math.max(0, Math.log2(result.size / side)) : 0;
}
