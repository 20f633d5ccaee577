// The viewer of one scene: reference, method and error map in one exposure, the strip of all error maps, the probe.
"use strict";

class Viewer {
  constructor(element, images, tables, changed) {
    this.element = element;
    this.images = images;
    this.tables = tables;
    this.changed = changed;  // called with (viewer, what changed) after the user changed something
    this.state = {method: Number(element.dataset.method), layer: "airlight", mode: "signed", stops: 0,
      view: "side", shown: "method", pixel: null, pinned: false};
    this.visible = false;
    this.stale = true;  // what is drawn is not what was asked for
    this.find = (selector) => element.querySelector(selector);
    this.canvases = {reference: this.find(".reference canvas"), method: this.find(".method canvas"),
      error: this.find(".error canvas")};
    this.controls = this.find(".controls");
    this.controls.hidden = false;
    this.find(".strip").hidden = false;
    this.find(".probe").hidden = false;
    this.listen();
  }

  get labels() { return this.images.index.methods.map((method) => method.label); }

  // The layer of which pictures and error map are.
  get layer() { return this.images.layerOf(this.state.method, this.state.layer); }

  get hasFlip() { return "flip" in this.images.index.methods[this.state.method].layers; }

  // The map that is drawn: HDR-FLIP falls back to signed errors where there is none.
  get mode() { return this.state.mode === "flip" && !this.hasFlip ? "signed" : this.state.mode; }

  get factor() { return this.images.index.exposure * 2 ** this.state.stops; }

  set(changes, tell = true) {
    Object.assign(this.state, changes);
    this.showControls();
    this.draw();
    if (tell) this.changed(this, changes);
  }

  // --- what the user does ---

  listen() {
    this.controls.addEventListener("input", ({target}) => {
      const {value} = target;
      if (target.dataset.sets === "layer" || target.dataset.sets === "mode") this.set({[target.dataset.sets]: value});
      else this.set({[target.dataset.sets]: Number(value)});
    });
    this.controls.addEventListener("click", ({target}) => {
      const what = target.closest("button")?.dataset.does;
      if (what === "reset") this.set({stops: 0});
      if (what === "side") this.set({view: "side"});
      if (what === "show") this.set({view: "flip", shown: target.dataset.shown});
    });
    this.find(".strip").addEventListener("click", ({target}) => {
      const button = target.closest("button");
      if (button) this.set({method: Number(button.dataset.method)});
    });
    this.find(".speed")?.addEventListener("click", ({target}) => {
      const point = target.closest("g[id^='point-']");
      if (point) this.set({method: Number(point.id.slice("point-".length))});
    });
    for (const canvas of Object.values(this.canvases)) {
      canvas.addEventListener("pointermove", (event) => this.state.pinned || this.probe(this.pixelAt(event), false));
      canvas.addEventListener("pointerdown", (event) => this.pin(this.pixelAt(event)));
      canvas.addEventListener("keydown", (event) => this.moveProbe(event));
    }
  }

  pixelAt({target, clientX, clientY}) {
    const box = target.getBoundingClientRect();
    const place = (at, length, count) => Math.min(count - 1, Math.max(0, Math.floor(at / length * count)));
    return [place(clientX - box.left, box.width, this.images.width),
      place(clientY - box.top, box.height, this.images.height)];
  }

  pin(pixel) {
    const same = this.state.pinned && this.state.pixel.join() === pixel.join();
    this.state.pinned = !same;
    this.probe(pixel, true);
  }

  moveProbe(event) {
    const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[event.key];
    if (!steps || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    const {width, height} = this.images;
    const [x, y] = this.state.pixel ?? [width >> 1, height >> 1];
    const far = event.shiftKey ? 10 : 1;
    const within = (value, count) => Math.min(count - 1, Math.max(0, value));
    const first = this.state.pixel === null ? 0 : far;
    this.state.pinned = true;
    this.probe([within(x + first * steps[0], width), within(y + first * steps[1], height)], true);
  }

  // --- drawing ---

  async load() {
    try {
      await this.images.loadMethod(this.state.method);
    } catch (error) {
      this.find(".method figcaption").textContent = `This browser cannot show the images: ${error.message}`;
      throw error;
    }
    this.draw();
  }

  // Load one image after the other, with the page free between them; draw the strip on the way.
  async loadAll() {
    for (let number = 0; number < this.labels.length; number++) {
      await this.images.loadMethod(number);
      this.drawStrip(number);
      await new Promise((resolve) => setTimeout(resolve));
    }
    this.showProbe();
    this.element.dataset.complete = "";
  }

  draw() {
    const {images, state, layer} = this;
    if (!images.reference || !images.methods[state.method]) {
      this.stale = true;
      if (this.visible) this.load();
      return;
    }
    const {width, height} = images;
    const bad = {
      reference: drawPicture(this.canvases.reference, width, height, (c, i) => images.radiance(layer, c, i), this.factor),
      method: drawPicture(this.canvases.method, width, height, (c, i) => images.value(state.method, layer, c, i),
        this.factor),
      error: this.drawError(this.canvases.error, state.method),
    };
    this.describe(bad);
    this.showProbe();
    this.stale = false;
    this.element.dataset.drawn = `${state.method} ${layer} ${this.mode} ${state.stops}`;
  }

  // Draw the error map of a method; return how many pixels are not finite.
  drawError(canvas, number) {
    const {images, state} = this;
    const layer = images.layerOf(number, state.layer);
    const mode = state.mode === "flip" && !images.methods[number].flip ? "signed" : state.mode;
    const {width, height} = images;
    const table = this.tables[mode], {colour} = MAPS[mode], {flip} = images.methods[number];
    return drawPixels(canvas, width, height, (i) => {
      const error = mode === "flip" ? flip[i] / 255 : images.worst(number, layer, i);
      return Number.isFinite(error) ? colour(table, error) : NaN;
    });
  }

  drawStrip(number) {
    const canvas = this.find(`.strip [data-method="${number}"] canvas`);
    const whole = document.createElement("canvas");
    this.drawError(whole, number);
    canvas.width = Math.min(200, whole.width);
    canvas.height = Math.max(1, Math.round(whole.height * canvas.width / whole.width));
    const context = canvas.getContext("2d");
    context.imageSmoothingQuality = "high";
    context.drawImage(whole, 0, 0, canvas.width, canvas.height);
  }

  // Draw the strip again where its images are there.
  redrawStrip() {
    this.images.methods.forEach((method, number) => { if (method && this.images.reference) this.drawStrip(number); });
  }

  // --- words ---

  describe(bad) {
    const {index} = this.images, {state, layer} = this;
    const label = this.labels[state.method];
    const holes = (count) => count ? `; ${count} pixel${count > 1 ? "s" : ""} not finite (hatched in magenta)` : "";
    const other = layer === state.layer ? "" : ` (it has no ${state.layer}: its ${layer} is shown)`;
    const map = MAPS[this.mode].words;
    const missing = this.mode === state.mode ? "" : " (no HDR-FLIP here)";
    this.find(".reference figcaption").textContent = `Reference (quadrature), ${layer}${holes(bad.reference)}`;
    this.find(".method figcaption").textContent = `${label}, ${layer}${other}${holes(bad.method)}`;
    const white = this.allWhite() ? `; all white: below ${percentWords(FLOOR)} in every pixel` : "";
    this.find(".error .what").textContent = `Error of ${label}: ${map}${missing}${white}${holes(bad.error)}`;
    const probe = "Arrow keys move the probe.";
    this.canvases.reference.setAttribute("aria-label", `${index.name}: reference, ${layer}. ${probe}`);
    this.canvases.method.setAttribute("aria-label", `${index.name}: ${label}, ${layer}. ${probe}`);
    this.canvases.error.setAttribute("aria-label", `${index.name}: error map of ${label}, ${map}. ${probe}`);
    this.showScale();
  }

  // Whether the map of signed errors shows none: an empty picture should say that it is meant.
  allWhite() {
    const {images, state, layer} = this;
    if (this.mode !== "signed") return false;
    for (let i = 0; i < images.width * images.height; i++)
      if (!(Math.abs(images.worst(state.method, layer, i)) < FLOOR)) return false;
    return true;
  }

  showScale() {
    const bar = this.find(".scale canvas"), ticks = this.find(".scale .ticks");
    const {mode} = this, table = this.tables[mode], marks = MAPS[mode].ticks();
    drawPixels(bar, table.length, 1, (i) => table[i]);
    // Where there are many ticks every second one has its words, and always both ends and the middle.
    const outer = mode === "signed" ? (marks.length - 1) / 2 : marks.length - 1;
    ticks.replaceChildren(...marks.map(([place, words], number) => {
      const tick = document.createElement("span");
      const step = mode === "signed" ? Math.abs(number - outer) : number;
      if (marks.length <= 7 || step === 0 || (step > 1 && (outer - step) % 2 === 0)) tick.textContent = words;
      tick.style.left = `${100 * place}%`;
      tick.className = place === 0 ? "first" : place === 1 ? "last" : "";
      return tick;
    }));
  }

  showControls() {
    const {state, controls} = this;
    for (const input of controls.querySelectorAll("[data-sets]")) {
      const value = state[input.dataset.sets];
      if (input.type === "radio") input.checked = input.value === value;
      else input.value = value;
    }
    controls.querySelector("output").textContent =
      `${state.stops > 0 ? "+" : state.stops < 0 ? "\u2212" : ""}${Math.abs(state.stops)} stops`;
    controls.querySelector("option[value=flip]").disabled = !this.hasFlip;
    for (const button of controls.querySelectorAll("button[data-does=show]"))
      button.setAttribute("aria-pressed", String(state.view === "flip" && button.dataset.shown === state.shown));
    controls.querySelector("button[data-does=side]").setAttribute("aria-pressed", String(state.view === "side"));
    const pictures = this.find(".pictures");
    pictures.classList.toggle("flip", state.view === "flip");
    for (const name of Object.keys(this.canvases))
      this.find(`.${name}`).classList.toggle("shown", name === state.shown);
    for (const button of this.element.querySelectorAll(".strip button"))
      button.setAttribute("aria-pressed", String(Number(button.dataset.method) === state.method));
    for (const point of this.element.querySelectorAll(".speed g[id^='point-']"))
      point.classList.toggle("chosen", point.id === `point-${state.method}`);
  }

  // --- the probe ---

  probe(pixel, speak) {
    this.state.pixel = pixel;
    this.showProbe();
    if (speak) this.changed(this, {spoken: this.probeWords()});
  }

  showProbe() {
    const {state, images} = this;
    const pins = this.element.querySelectorAll(".pin");
    if (!state.pixel) return;
    const [x, y] = state.pixel, i = y * images.width + x;
    for (const pin of pins) {
      pin.hidden = false;
      pin.style.left = `${100 * (x + 0.5) / images.width}%`;
      pin.style.top = `${100 * (y + 0.5) / images.height}%`;
    }
    const {stride} = images.index;
    this.find(".probe .where").textContent = `Pixel (${x * stride}, ${y * stride})${state.pinned ? ", held" : ""}: `
      + `${state.layer}, W/(m\u00b2 sr)`;
    const rows = this.element.querySelectorAll(".probe tbody tr");
    const fill = (row, words) => words.forEach((word, n) => { row.cells[n + 1].textContent = word; });
    if (images.reference)
      fill(rows[0], [0, 1, 2].map((c) => numberWords(images.radiance(state.layer, c, i))));
    images.methods.forEach((method, number) => {
      const row = rows[number + 1];
      row.classList.toggle("chosen", number === state.method);
      if (method && images.reference) fill(row, this.probeRow(number, i));
    });
  }

  probeRow(number, i) {
    const {images, state} = this;
    const layer = images.layerOf(number, state.layer);
    const {flip} = images.methods[number];
    const values = [0, 1, 2].map((c) => numberWords(images.value(number, layer, c, i)));
    if (layer !== state.layer) values[0] = `${layer}: ${values[0]}`;
    return [...values, errorWords(images.worst(number, layer, i)), flip ? (flip[i] / 255).toFixed(3) : "\u2013"];
  }

  probeWords() {
    const {images, state, layer} = this;
    if (!images.reference || !images.methods[state.method]) return "";
    const [x, y] = state.pixel, i = y * images.width + x, {stride} = images.index;
    const mean = (at) => numberWords((at(0) + at(1) + at(2)) / 3, 3);
    return `Pixel ${x * stride}, ${y * stride}. Reference ${mean((c) => images.radiance(layer, c, i))}, `
      + `${this.labels[state.method]} ${mean((c) => images.value(state.method, layer, c, i))}, `
      + `error ${errorWords(images.worst(state.method, layer, i))}.`;
  }
}
