// The page: controls, panes and pointing, wired together.  Drawn when something has changed, not all the time.
import * as THREE from "three";
import { FLIPPED, OVERLAPPING, pointOf, readData } from "data";
import { Stage } from "stage";
import { Orbit, Pane, Sheet } from "panes";
import { described, normalOf, spotAt } from "pointing";

const CARD = "test card", RESTING = 120, REPEAT = 1 / 100;
const NAMES = { checker: "Checker", [CARD]: "Test card", charts: "Charts", distortion: "Distortion", plain: "Plain" };
const by = (id) => document.getElementById(id);

class Page {
  constructor(data) {
    this.data = data;
    this.stage = new Stage();
    this.orbit = new Orbit();
    this.spot = null; // { mesh, face, weights, result }
    this.settings = { look: "checker", cells: 32, level: 0, seams: true, size: 1024, pictures: new Map() };
    this.panes = [];
    this.makeLooks();
    this.makeResults();
    this.countMarks();
    this.listen();
    this.readControls();
  }

  makeLooks() {
    const maps = [...new Set(this.data.results.flatMap((result) => Object.keys(result.pictures)))];
    for (const name of ["checker", CARD, "charts", "distortion", "plain", ...maps])
      by("looks").append(choice("radio", "look", name, NAMES[name] ?? `Map: ${name}`, name === "checker"));
    for (const result of this.data.results) {
      const pictures = { [CARD]: this.data.card, ...result.pictures };
      this.settings.pictures.set(result, new Map(Object.entries(pictures).map(([name, uri]) => [name, this.texture(uri, name)])));
    }
  }

  texture(uri, name) {
    const texture = new THREE.TextureLoader().load(uri, () => this.redraw());
    texture.isCard = name === CARD;
    texture.anisotropy = 4;
    texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    return texture;
  }

  makeResults() {
    const { results } = this.data;
    results.forEach((result, number) => {
      const shown = results.length < 2 || result.title !== "before" || results.length > 2;
      by("shown").lastElementChild.append(choice("checkbox", "result", String(number), result.title, shown));
      const box = document.createElement("div"), title = document.createElement("h2");
      box.className = "result";
      title.textContent = result.title;
      const model = new Pane(result, false, this.orbit, `Model of ${result.title}`);
      const layout = new Pane(result, true, new Sheet(result.extent), `uv layout of ${result.title}`);
      box.append(title, model.canvas, layout.canvas);
      by("panes").append(box);
      this.panes.push(model, layout);
    });
    by("shown").hidden = results.length < 2;
  }

  /** How many triangles of each result a mark is on. */
  countMarks() {
    for (const [name, bit] of [["flipped", FLIPPED], ["overlapping", OVERLAPPING]]) {
      const counts = this.data.results.map(({ flags }) => flags.reduce((sum, flag) => sum + Number((flag & bit) > 0), 0));
      by(`${name}-count`).textContent = counts.some(Boolean) ? counts.join(" · ") : "none";
    }
  }

  listen() {
    by("controls").addEventListener("input", () => this.readControls());
    by("controls").addEventListener("submit", (event) => event.preventDefault());
    by("theme").addEventListener("click", () => this.setTheme(!this.dark));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => this.setTheme(event.matches));
    this.setTheme(window.matchMedia("(prefers-color-scheme: dark)").matches);
    new ResizeObserver(() => this.redraw()).observe(by("panes"));
    for (const pane of this.panes) {
      listenToPointer(pane, this);
      pane.canvas.addEventListener("keydown", (event) => this.key(pane, event));
    }
  }

  setTheme(dark) {
    this.dark = dark;
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    by("theme").textContent = dark ? "Light" : "Dark";
    by("theme").setAttribute("aria-pressed", String(dark));
    this.settings.seamColor = getComputedStyle(document.documentElement).getPropertyValue("--seam").trim();
    this.redraw();
  }

  readControls() {
    const form = new FormData(by("controls")), { settings } = this;
    settings.look = form.get("look");
    for (const name of ["seams", "edges", "flipped", "overlapping"]) settings[name] = form.has(name);
    const { elements } = by("controls");
    settings.cells = 2 ** Number(elements.cells.value);
    settings.level = Number(elements.level.value);
    const shown = new Set(form.getAll("result").map(Number));
    [...by("panes").children].forEach((box, number) => { box.hidden = !shown.has(number) && this.data.results.length > 1; });
    [...by("panes").children].forEach((box) => { box.style.display = box.hidden ? "none" : ""; });
    by("panes").classList.toggle("alone", [...by("panes").children].filter((box) => !box.hidden).length === 1);
    this.saySettings(elements);
    this.redraw();
  }

  saySettings(elements) {
    const { settings, data } = this;
    const checker = settings.look === "checker", picture = !(settings.look in NAMES) || settings.look === CARD;
    elements.cells.disabled = !checker;
    elements.level.disabled = !picture;
    by("cells-label").classList.toggle("off", !checker);
    by("level-label").classList.toggle("off", !picture);
    by("cells-value").textContent = `${settings.cells} texel${settings.cells > 1 ? "s" : ""}`;
    by("level-value").textContent = settings.level ? `${settings.level}${this.cleanUpTo()}` : "smooth";
    by("legend").hidden = settings.look !== "distortion";
    const reach = data.top < 2 ? `${(100 * (data.top - 1)).toFixed(0)} %` : `distortion ${data.top}`;
    by("legend-low").textContent = `smaller in uv, ${reach}`;
    by("legend-high").textContent = `larger in uv, ${reach}`;
    paintScale(by("legend-bar"), data.heat);
  }

  cleanUpTo() {
    const known = this.data.results.map((result) => result.cleanMip).filter((level) => Number.isInteger(level));
    return known.length ? (this.settings.level <= Math.min(...known) ? ", charts apart" : ", charts mix") : "";
  }

  /** What a pane shows is where the pointer is; null when it is nowhere. */
  point(pane, x, y) {
    const found = spotAt(this.stage, pane, x, y);
    this.spot = found && { ...found, result: pane.result };
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.say(), RESTING);
    this.redraw();
  }

  say() {
    const { spot } = this;
    by("readout").textContent = spot ? described(spot.result, spot, this.data.fineness) : "Nothing of the surface is there.";
  }

  /** Turn the model, and move the layouts, to the spot pointed at. */
  turnTo(pane) {
    const { spot } = this;
    if (!spot) return;
    for (const other of this.panes.filter((entry) => entry !== pane && this.shares(entry, spot)))
      other.view.face(this.placeOf(other), normalOf(other.result, spot.face));
    this.redraw();
  }

  /** The spot pointed at as a point of a pane: on the surface, or in uv. */
  placeOf(pane) { return pointOf(pane.result, this.spot, pane.flat); }

  shares(pane, spot) { return pane.result.mesh === spot.result.mesh && spot.face < pane.result.faceCount; }

  key(pane, event) {
    const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const middle = () => this.point(pane, pane.canvas.width >> 1, pane.canvas.height >> 1);
    const actions = {
      "+": () => pane.view.zoom(1), "=": () => pane.view.zoom(1), "-": () => pane.view.zoom(-1), 0: () => pane.view.reset(),
      " ": middle, Enter: () => { middle(); this.turnTo(pane); },
    };
    const action = event.key in arrows ? () => pane.view.arrow(...arrows[event.key]) : actions[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action();
    this.redraw();
  }

  redraw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      for (const pane of this.panes) if (pane.canvas.offsetParent && pane.fit()) this.drawPane(pane);
      document.documentElement.dataset.drawn = String(Number(document.documentElement.dataset.drawn ?? 0) + 1);
    });
  }

  drawPane(pane) {
    const { spot } = this, shared = spot && this.shares(pane, spot);
    this.stage.draw(pane, this.settings, shared ? spot.face : -1);
    if (shared) pane.ring(this.placeOf(pane), "#ffd21f");
  }
}

/** Drags, clicks, wheel and two fingers on a pane. */
function listenToPointer(pane, page) {
  const { canvas } = pane, held = new Map();
  let moved = 0;
  const apart = () => { const [a, b] = [...held.values()]; return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY); };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, event); moved = 0; });
  canvas.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return page.point(pane, ...pane.pixel(event));
    const before = held.size > 1 ? apart() : 0;
    held.set(event.pointerId, event);
    moved += Math.abs(event.clientX - last.clientX) + Math.abs(event.clientY - last.clientY);
    if (before) pane.view.zoom((apart() - before) * REPEAT * 4);
    else pane.view.drag(event.clientX - last.clientX, event.clientY - last.clientY, event.shiftKey || last.button > 0, canvas.clientWidth);
    page.redraw();
  });
  canvas.addEventListener("pointerup", (event) => {
    held.delete(event.pointerId);
    if (moved > 4) return;
    page.point(pane, ...pane.pixel(event));
    page.turnTo(pane);
  });
  canvas.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); pane.view.zoom(-event.deltaY * REPEAT); page.redraw(); }, { passive: false });
}

function choice(type, name, value, text, checked) {
  const label = document.createElement("label"), input = document.createElement("input");
  Object.assign(input, { type, name, value, checked });
  label.append(input, ` ${text}`);
  return label;
}

function paintScale(canvas, heat) {
  const context = canvas.getContext("2d"), row = context.createImageData(canvas.width, 1);
  for (let step = 0; step < canvas.width; step++) row.data.set([...heat.subarray(3 * step, 3 * step + 3), 255], 4 * step);
  context.putImageData(row, 0, 0);
}

try {
  window.flexparaReport = new Page(await readData());
} catch (error) {
  by("problem").hidden = false;
  by("problem").textContent = `The views can't be drawn (${error.message}); the numbers below stand. A browser with WebGL 2 shows them.`;
}
