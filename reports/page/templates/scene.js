// The images of one scene: decoded when asked for, as radiance of the reference and relative differences of the methods.
"use strict";

class SceneImages {
  constructor(index, element) {
    this.index = index;
    this.element = element;
    [this.width, this.height] = index.size;
    this.drop();
  }

  // Forget what was decoded; it is decoded again when it is asked for.
  drop() {
    this.bytes = null;
    this.reference = null;
    this.methods = this.index.methods.map(() => null);
    this.loading = new Map();
  }

  get complete() { return this.reference !== null && this.methods.every((method) => method !== null); }

  async planes(entry, bits) {
    this.bytes ??= bytesOfBase64(this.element.textContent.trim());
    const raw = await inflated(this.bytes.subarray(entry.at, entry.at + entry.bytes));
    return decodedPlanes(raw, this.width, this.height, bits);
  }

  // Do some work once, however often it is asked for.
  once(what, work) {
    if (!this.loading.has(what)) this.loading.set(what, work());
    return this.loading.get(what);
  }

  loadReference() {
    return this.once("reference", async () => {
      const layers = {};
      for (const [name, entry] of Object.entries(this.index.reference))
        layers[name] = (await this.planes(entry, 24)).map(referenceValues);
      layers.total = layers.airlight.map((values, c) => values.map((value, i) => value + layers.surface[c][i]));
      this.reference = layers;
    });
  }

  loadMethod(number) {
    return this.once(number, async () => {
      await this.loadReference();
      const loaded = {};
      for (const [name, entry] of Object.entries(this.index.methods[number].layers)) {
        if (name === "flip") [loaded.flip] = await this.planes(entry, 8);
        else loaded[name] = (await this.planes(entry, 16)).map((p) => differenceValues(p, ...this.index.scale));
      }
      this.methods[number] = loaded;
    });
  }

  // What the errors of a pixel are relative to.
  unit(layer, channel, i) {
    const value = Math.abs(this.reference[layer][channel][i]);
    return Number.isFinite(value) ? Math.max(value, this.index.floors[layer]) : this.index.floors[layer];
  }

  // Which layer a method can show where another is asked for: an image without layers has its total alone.
  layerOf(number, layer) {
    const there = this.index.methods[number].layers;
    if ("total" in there) return "total";
    if (layer in there || (layer === "total" && "surface" in there)) return layer;
    return "airlight";
  }

  // Relative difference of a method from the reference.
  difference(number, layer, c, i) {
    const method = this.methods[number];
    if (method[layer]) return method[layer][c][i];
    return (method.airlight[c][i] * this.unit("airlight", c, i) + method.surface[c][i] * this.unit("surface", c, i))
      / this.unit("total", c, i);
  }

  // Radiance of the reference.
  radiance(layer, c, i) { return this.reference[layer][c][i]; }

  // Radiance of a method.
  value(number, layer, c, i) {
    const reference = this.reference[layer][c][i];
    return (Number.isFinite(reference) ? reference : 0) + this.difference(number, layer, c, i) * this.unit(layer, c, i);
  }

  // The relative difference of the channel that differs most, with its sign; NaN where any is not finite.
  worst(number, layer, i) {
    let worst = 0;
    for (let c = 0; c < 3; c++) {
      const error = this.difference(number, layer, c, i);
      if (!Number.isFinite(error) || !Number.isFinite(this.reference[layer][c][i])) return NaN;
      if (Math.abs(error) > Math.abs(worst)) worst = error;
    }
    return worst;
  }
}
