// SPDX-License-Identifier: BSD-3-Clause
// What the scripts of pages ask of a browser, as far as their arithmetic goes: elements that keep what is put into them.
"use strict";

class Element {
  constructor() {
    Object.assign(this, {dataset: {}, style: {setProperty() {}}, found: {}, listeners: {}, cells: [], hidden: false});
    Object.assign(this, {width: 0, height: 0, value: "", valueAsNumber: 0, textContent: ""});
    this.classList = {toggle() {}};
  }
  querySelector(selector) { return this.found[selector] ??= new Element(); }
  querySelectorAll() { return []; }
  addEventListener(kind, heard) { this.listeners[kind] = heard; }
  setAttribute(name, value) { this[name] = value; }
  append() {}
  replaceChildren() {}
  contains() { return false; }
  getBoundingClientRect() { return {left: 10, top: 20, width: 200, height: 100}; }
  getContext() {
    const image = (width, height) => ({data: new Uint8ClampedArray(4 * width * height)});
    return {createImageData: image, putImageData: ({data}) => { this.pixels = data; }};
  }
}

const document = new Element();
document.documentElement = new Element();
document.createElement = () => new Element();
const sent = [];
class WebSocket {
  static OPEN = 1;
  readyState = 1;
  send(text) { sent.push(JSON.parse(text)); }
}
class URL {}
const location = {href: "http://localhost/"}, navigator = {}, performance = {now: () => 1000};
const setInterval = () => 0, requestAnimationFrame = () => 0;
