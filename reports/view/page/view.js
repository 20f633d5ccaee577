// SPDX-License-Identifier: BSD-3-Clause
// The page of `airlight view`. It draws the pictures that come through the socket, moves the camera, and makes widgets
// from what it is told can be changed. It knows no method and no parameter by name.
"use strict";

const $ = (selector) => document.querySelector(selector);
const make = (tag, values = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), values);
  element.append(...children);
  return element;
};

// Vectors ---------------------------------------------------------------------------------------------------------

const add = (a, b, s = 1) => a.map((v, i) => v + s * b[i]);
const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const times = (a, s) => a.map((v) => v * s);
const length = (a) => Math.hypot(...a);
const unit = (a) => times(a, 1 / length(a));
const turned = (v, axis, angle) => {  // Rodrigues
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(times(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
};

// The socket ------------------------------------------------------------------------------------------------------

const socket = new WebSocket(new URL("socket", location.href.replace(/^http/, "ws")));
socket.binaryType = "arraybuffer";
const say = (kind, values = {}) => {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({kind, ...values}));
};
const hear = {};
socket.onmessage = ({data}) => {
  if (typeof data === "string") {
    const said = JSON.parse(data);
    hear[said.kind]?.(said);
    return;
  }
  const size = new DataView(data).getUint32(0, true);
  const said = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, size)));
  hear[said.kind]?.(said, new Uint8ClampedArray(data, 4 + size));
};
const ended = (why) => {
  document.documentElement.dataset.ended = why;
  $("#mistake").textContent = why;
};
socket.onclose = () => document.documentElement.dataset.ended ?? ended("The view has ended. Start the command again.");
hear.closed = ({message}) => ended(`Closed: ${message}.`);
hear.mistake = ({message}) => { $("#mistake").textContent = message; };

// Pictures --------------------------------------------------------------------------------------------------------

// A canvas in memory: without a graphics card, one of the card's is drawn by the processors and read back.
const CONTEXT = {alpha: false, willReadFrequently: true};
const put = (canvas, [width, height], pixels) => {
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
  canvas.getContext("2d", CONTEXT).putImageData(new ImageData(pixels, width, height), 0, 0);
};
const arrivals = [];
let browser = 0, costs = null;
hear.frame = (said, pixels) => {
  const begin = performance.now();
  put($("#method"), said.size, pixels);
  const now = performance.now();
  browser = now - begin;
  if (now - arrivals.at(-1) > 3000) arrivals.length = 0;
  arrivals.push(now);
  while (arrivals.length > 4 && now - arrivals[0] > 2000) arrivals.shift();
  say("drawn", {frame: said.frame});
  camera.taken = said.taken;
  if (camera.moved) aimed();
  costs = {...said, change_ms: said.change_ms ?? costs?.change_ms ?? null, told: false};
  document.documentElement.dataset.frame = said.frame;
};
hear.other = (said, pixels) => {
  put($("#other"), said.size, pixels);
  $("#other").dataset.known = said.known / said.pixels;
};
// Of the last two seconds, or of four frames where these take longer.
const rate = () => {
  if (performance.now() - arrivals.at(-1) > 3000) return 0;
  return arrivals.length > 1 ? 1000 * (arrivals.length - 1) / (arrivals.at(-1) - arrivals[0]) : 0;
};
setInterval(() => {
  const frames = rate();
  $("#fps").textContent = frames < 10 ? frames.toFixed(1) : frames.toFixed(0);
  document.documentElement.dataset.fps = frames;
  if (costs && !costs.told) tellTimes(costs);
}, 250);

let stageWords = {};
const tellTimes = (said) => {
  said.told = true;
  const rows = Object.entries(said.stages).map(([name, ms]) => [stageWords[name] ?? name, ms]);
  const total = said.frame_ms + said.picture_ms + browser;
  rows.push(["frame, its stages overlapping", said.frame_ms, "sum"], ["picture", said.picture_ms], ["in the browser", browser]);
  rows.push(["all", total, "sum"]);
  $("#times tbody").replaceChildren(...rows.map(([name, ms, kind = ""]) =>
    make("tr", {className: kind}, make("th", {scope: "row", textContent: name}), make("td", {textContent: ms.toFixed(1)}))));
  $("#cost").textContent = `· ${said.frame_ms.toFixed(1)} ms a frame`;
  if (said.change_ms !== null) {
    $("#change").textContent = `The last change took ${said.change_ms.toFixed(0)} ms until its first frame.`;
    document.documentElement.dataset.change = said.change_ms;
  }
};

// What is not known is not zero, as in the dark, where nothing is relative to the reference.
const percent = (fraction) => fraction === null ? "not known" : `${(100 * fraction).toPrecision(3)} %`;
const small = (fraction) => fraction === null ? "not known" : `${(100 * fraction).toExponential(1)} %`;
hear.error = ({failure, error, done, frames, mean}) => {
  const words = $("#error");
  document.documentElement.dataset.reference = failure ? "failed" : done ? "done" : error ? "known" : "none";
  if (failure) words.textContent = `No reference: ${failure}`;
  else if (!error) words.textContent = "The reference begins when nothing moves.";
  else {
    const part = error.known === error.pixels ? "all pixels" : `${error.known} of ${error.pixels} pixels`;
    const interval = error.known === error.pixels ? "" : ` ± ${percent(error.interval)}`;
    words.textContent = `Error of the airlight against the reference: RMSE ${percent(error.relative_rmse)}${interval}, ` +
      `bias ${percent(error.relative_bias)} of the mean; 99 % of pixels within ${percent(error.p99)}; ${part}; ` +
      `the reference's own error ${small(error.own_error)}.` +
      (frames ? ` Mean of ${frames} frames at rest: RMSE ${percent(mean)}.` : "");
    document.documentElement.dataset.rmse = error.relative_rmse;
  }
  $("#known").value = error ? error.known / error.pixels : 0;
  $("#other").dataset.stale = String(!error);
};

hear.motion = ({rmse, interval, frames, pixels}) => {
  $("#motion").textContent = `While the scene changed: RMSE ${percent(rmse)} ± ${percent(interval)}, of ${frames} ` +
    `${frames === 1 ? "frame" : "frames"} as shown, each against its own reference in ${pixels} pixels by chance.`;
};

// The camera ------------------------------------------------------------------------------------------------------

const camera = {origin: [0, 0, 0], target: [0, 1, 0], up: [0, 0, 1], vertical: [0, 0, 1], moved: false, waits: false, last: 0, sent: 0, taken: 0, held: new Set()};
// Nothing is asked of the browser while nothing moves.
const aimed = () => {
  camera.moved = true;
  if (!camera.waits) requestAnimationFrame(step);
  camera.waits = true;
};
const forward = () => unit(add(camera.target, camera.origin, -1));
const right = () => unit(cross(forward(), camera.vertical));
const straight = (direction) => Math.abs(dot(unit(direction), camera.vertical)) > 0.998;
const orbit = (yaw, pitch) => {
  let arm = turned(add(camera.origin, camera.target, -1), camera.vertical, yaw);
  const lifted = turned(arm, unit(cross(times(arm, -1), camera.vertical)), pitch);
  if (!straight(lifted)) arm = lifted;
  camera.origin = add(camera.target, arm);
  camera.up = camera.vertical;
  aimed();
};
const look = (yaw, pitch) => {
  let aim = turned(add(camera.target, camera.origin, -1), camera.vertical, yaw);
  const lifted = turned(aim, unit(cross(aim, camera.vertical)), pitch);
  if (!straight(lifted)) aim = lifted;
  camera.target = add(camera.origin, aim);
  camera.up = camera.vertical;
  aimed();
};
const pan = (across, upward) => {
  const shift = add(times(right(), across), cross(right(), forward()), upward);
  camera.origin = add(camera.origin, shift);
  camera.target = add(camera.target, shift);
  aimed();
};
const dolly = (fraction) => {
  const arm = times(add(camera.origin, camera.target, -1), Math.exp(fraction));
  if (length(arm) > 1e-3 * camera.reach) camera.origin = add(camera.target, arm);
  aimed();
};
const fly = (along, across, upward) => {
  const shift = add(add(times(forward(), along), right(), across), camera.vertical, upward);
  camera.origin = add(camera.origin, shift);
  camera.target = add(camera.target, shift);
  aimed();
};

const stage = $("#stage");
let drag = null;
stage.addEventListener("pointerdown", (event) => {
  stage.focus();
  stage.setPointerCapture(event.pointerId);
  drag = {x: event.clientX, y: event.clientY, seam: event.target.id === "seam",
    pan: event.button === 2 || event.button === 1 || event.shiftKey};
  event.preventDefault();
});
stage.addEventListener("pointermove", (event) => {
  if (!drag) return;
  const box = $("#method").getBoundingClientRect();
  const dx = (event.clientX - drag.x) / box.width, dy = (event.clientY - drag.y) / box.width;
  Object.assign(drag, {x: event.clientX, y: event.clientY});
  if (drag.seam) return setWipe(100 * (event.clientX - box.left) / box.width);
  const reach = length(add(camera.target, camera.origin, -1));
  if (drag.pan) pan(-dx * reach, dy * reach);
  else if ($("#mouse").value === "fly") look(dx * 1.5, dy * 1.5);
  else orbit(-dx * 4, -dy * 4);
});
const release = () => { drag = null; };
stage.addEventListener("pointerup", release);
stage.addEventListener("pointercancel", release);
stage.addEventListener("contextmenu", (event) => event.preventDefault());
stage.addEventListener("wheel", (event) => {
  const clicks = Math.sign(event.deltaY);
  if ($("#mouse").value === "fly") fly(-clicks * 0.1 * camera.reach, 0, 0);
  else dolly(clicks * 0.08);
  event.preventDefault();
}, {passive: false});
const flying = {KeyW: [1, 0, 0], KeyS: [-1, 0, 0], KeyA: [0, -1, 0], KeyD: [0, 1, 0], KeyE: [0, 0, 1], KeyQ: [0, 0, -1]};
const pressing = {ArrowLeft: () => orbit(-0.05, 0), ArrowRight: () => orbit(0.05, 0), ArrowUp: () => orbit(0, -0.05),
  ArrowDown: () => orbit(0, 0.05), "+": () => dolly(-0.08), "-": () => dolly(0.08)};
stage.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (flying[event.code]) {
    if (!camera.held.size) camera.last = performance.now();
    camera.held.add(event.code);
    aimed();
  }
  else if (pressing[event.key]) pressing[event.key]();
  else return;
  event.preventDefault();
});
stage.addEventListener("keyup", (event) => camera.held.delete(event.code));
stage.addEventListener("blur", () => camera.held.clear());

const step = (now) => {
  camera.waits = false;
  const seconds = Math.min((now - camera.last) / 1000, 0.1);
  camera.last = now;
  for (const key of camera.held) fly(...times(flying[key], 0.6 * seconds * camera.reach));
  // More than two that no frame shows yet would only wait there: a frame asks for the next.
  if (!camera.moved || camera.sent - camera.taken >= 2) return;
  camera.sent += 1;
  camera.moved = camera.held.size > 0;
  const {origin, target, up} = camera;
  const short = (vector) => vector.map((value) => Number(value.toPrecision(7)));
  say("change", {moves: camera.sent, changes: {"camera.origin": short(origin), "camera.target": short(target), "camera.up": short(up)}});
};

// How the pictures lie --------------------------------------------------------------------------------------------

const setWipe = (fraction) => {
  $("#wipe").value = fraction;
  stage.style.setProperty("--wipe", `${Math.min(Math.max(fraction, 0), 100)}%`);
};
const arrange = () => {
  const beside = $("#beside").value, layout = beside === "none" ? "one" : $("#layout").value;
  stage.dataset.layout = layout;
  $("#other").hidden = beside === "none";
  $("#seam").hidden = layout !== "wipe";
  $("#scale").hidden = beside !== "error";
  $("#left").textContent = beside === "none" ? "" : "method";
  $("#right").hidden = beside === "none";
  $("#right").textContent = beside === "reference" ? "reference" : "error of the airlight";
};
const show = (more = {}) => {
  arrange();
  const exposure = Number.isFinite($("#exposure").valueAsNumber) ? $("#exposure").valueAsNumber : 0;
  say("show", {layer: $("#layer").value, exposure, other: $("#beside").value, run: $("#run").checked, ...more});
};
$("#beside").addEventListener("input", () => {
  const canvas = $("#other");
  canvas.getContext("2d").clearRect(0, 0, canvas.width, canvas.height);
});
for (const name of ["layer", "exposure", "beside", "run"]) $(`#${name}`).addEventListener("input", () => show());
$("#layout").addEventListener("input", arrange);
$("#wipe").addEventListener("input", () => setWipe($("#wipe").value));
$("#expose").addEventListener("click", () => { $("#exposure").value = 0; show({expose: true}); });

// Widgets ---------------------------------------------------------------------------------------------------------

const options = (select, names) => select.replaceChildren(...names.map((name) => make("option", {value: name, textContent: name})));
// A range that spans decades has a slider of its logarithm, where all of it is above 0.
const spans = (least, most, value) => {
  if (least === null || most === null || !(most - least < 1e6)) return value > 0 ? [value / 30, value * 30, true] : null;
  return least > 0 && most / least > 200 ? [least, most, true] : [least, most, false];
};
const slider = (value, [least, most, decades], whole, moved) => {
  const place = (v) => decades ? Math.log(v / least) / Math.log(most / least) : (v - least) / (most - least);
  const input = make("input", {type: "range", min: 0, max: 1, step: "any", value: place(value), tabIndex: -1});
  input.setAttribute("aria-hidden", "true");  // the number beside it says the same
  input.addEventListener("input", () => {
    const fraction = input.valueAsNumber;
    let chosen = decades ? least * (most / least) ** fraction : least + fraction * (most - least);
    chosen = whole ? Math.round(chosen) : Number(chosen.toPrecision(3));
    moved(Math.min(Math.max(chosen, least), most));
  });
  return input;
};
const numberField = (label, values, {least, most, whole = false, unit = "", help = ""}, changed) => {
  const legend = unit ? `${label} [${unit}]` : label;
  const inputs = values.map((value, number) => {
    const input = make("input", {type: "number", step: values.length > 1 ? 0.1 : "any", value: Number(value.toPrecision(7))});
    input.setAttribute("aria-label", values.length > 1 ? `${legend}, number ${number + 1}` : legend);
    input.addEventListener("change", () => changed(inputs.map((one) => one.valueAsNumber)));
    return input;
  });
  const row = make("div", {className: "values"}, ...inputs);
  // Of a colour, which has no negative numbers, the slider keeps the hue.
  const largest = Math.max(...values), slides = values.length === 1 || (least === 0 && largest > 0);
  const range = slides ? spans(least, most, largest) : null;
  if (range) {
    row.append(slider(largest, range, whole, (value) => {
      const scaled = values.length === 1 ? [value] : values.map((one) => Number((one * value / largest).toPrecision(5)));
      inputs.forEach((input, number) => { input.value = scaled[number]; });
      changed(scaled);
    }));
  }
  return make("div", {className: "field", title: help}, make("span", {textContent: legend}), row);
};
const parameterField = (item) => {
  const choose = (value) => say("choose", {parameter: item.name, value});
  if (item.kind === "number") return numberField(item.name, [item.value], item, ([value]) => choose(Number.isFinite(value) ? value : ""));
  let input;
  if (item.kind === "choice") {
    input = make("select");
    options(input, item.choices.map(String));
    input.value = String(item.value);
    input.addEventListener("change", () => choose(input.value));
  } else if (item.kind === "switch") {
    input = make("input", {type: "checkbox", checked: item.value});
    input.addEventListener("change", () => choose(input.checked));
  } else {
    input = make("input", {type: "text", value: item.value});
    input.addEventListener("change", () => choose(input.value));
  }
  input.setAttribute("aria-label", item.name);
  return make("div", {className: "field", title: item.help}, make("span", {textContent: item.name}), make("div", {className: "values"}, input));
};
const sceneField = (item) => numberField(item.name, item.value, item, (value) => say("change", {changes: {[item.name]: value}}));

let kernels = [], methods = [], chosenKernel = null, commands = {};
hear.opened = (said) => {
  $("#scene").textContent = `${said.scene}, ${said.size[0]} × ${said.size[1]}`;
  document.title = `${said.scene} · airlight view`;
  ({methods, kernels} = said);
  stageWords = said.stages;
  options($("#choose-method"), methods.map(({name}) => name));
  options($("#choose-kernel"), kernels.map(({name}) => name));
  options($("#layer"), said.layers);
  $("#layer").value = said.show.layer;
  $("#exposure").value = said.show.exposure;
  $("#beside").value = said.show.other;
  $("#run").checked = said.show.run;
  const colours = said.scale.colours, canvas = $("#colours");
  canvas.width = colours.length;
  canvas.getContext("2d", CONTEXT).putImageData(new ImageData(new Uint8ClampedArray(colours.flatMap((c) => [...c, 255])), colours.length, 1), 0, 0);
  $("#below").textContent = `${percent(-said.scale.ceiling)} too dark`;
  $("#above").textContent = `${percent(said.scale.ceiling)} too bright, white below ${percent(said.scale.floor)}`;
  Object.assign(camera, {started: false, sent: 0, taken: 0});
  arrange();
};
// What is in the user's hand stays as it is: a slider, and a number that is half typed.
document.addEventListener("input", ({target}) => { target.dataset.typing = "1"; });
document.addEventListener("change", ({target}) => { delete target.dataset.typing; }, {capture: true});
const redraw = (place, fields) => {
  const at = document.activeElement;
  if (place.contains(at) && (at.type === "range" || at.dataset.typing)) return;
  const label = place.contains(at) ? at.getAttribute("aria-label") : null;
  place.replaceChildren(...fields);
  if (label) place.querySelector(`[aria-label="${CSS.escape(label)}"]`)?.focus();
};
hear.state = (said) => {
  $("#choose-method").value = said.method;
  $("#summary").textContent = methods.find(({name}) => name === said.method)?.summary ?? "";
  $("#kernel").hidden = !said.calls_kernel;
  if (said.kernel) tellKernel(said.kernel);
  redraw($("#parameters"), said.parameters.map(parameterField));
  const of = (part) => said.changeable.filter(({name}) => name.startsWith("camera.") === part).map(sceneField);
  redraw($("#lights"), of(false));
  redraw($("#camera"), of(true));
  const there = Object.fromEntries(said.changeable.map(({name, value}) => [name, value]));
  if (!camera.moved && !drag && !camera.held.size) takeCamera(there);
  $("#notes").hidden = !said.notes.length;
  $("#notes p").textContent = said.notes.join("; ");
  commands = said.commands;
  tellCommand();
  document.documentElement.dataset.told = String(Number(document.documentElement.dataset.told ?? 0) + 1);
};
// A camera as it was read has a target one metre away: the mouse turns about one that lies as deep in the view as the
// light, or as far away where the light is beside it or behind.
const takeCamera = (there) => {
  const place = there["camera.origin"], aim = unit(add(there["camera.target"], place, -1));
  // What the page has sent comes back rounded; another place or aim was typed.
  const near = (a, b, scale) => length(add(a, b, -1)) < 1e-4 * scale;
  const own = camera.started && near(place, camera.origin, camera.reach + length(place))
    && near(aim, forward(), 1 + length(place) / camera.reach);
  camera.origin = place;
  if (!own) {
    const light = there["light.position"];
    const way = light ? add(light, camera.origin, -1) : [0, 0, 0], depth = dot(way, aim);
    camera.reach = depth > 0.1 * length(way) ? depth : length(way) || 3;
    const axis = there["camera.up"].map(Math.abs);
    const largest = axis.indexOf(Math.max(...axis));
    camera.vertical = axis.map((_, i) => i === largest ? Math.sign(there["camera.up"][i]) : 0);
    camera.target = add(camera.origin, aim, camera.reach);
  }
  camera.started = true;
};
const tellKernel = (name) => {
  const record = kernels.filter((kernel) => name === kernel.name || name.startsWith(`${kernel.name}-`))
    .sort((a, b) => b.name.length - a.name.length)[0];
  chosenKernel = record;
  if (!record) return;
  $("#choose-kernel").value = record.name;
  const label = $("#kernel-size");
  label.hidden = !record.number;
  if (record.number) {
    label.querySelector("span").textContent = record.number[0];
    label.querySelector("input").value = name === record.name ? record.number[1] : name.slice(record.name.length + 1);
  }
};
const tellCommand = () => { $("#command").textContent = commands[$("#which").value] ?? ""; };
$("#which").addEventListener("input", tellCommand);
$("#copy").addEventListener("click", () => navigator.clipboard?.writeText($("#command").textContent));
$("#choose-method").addEventListener("change", () => say("choose", {method: $("#choose-method").value}));
$("#choose-kernel").addEventListener("change", () => say("choose", {kernel: $("#choose-kernel").value}));
$("#kernel-size input").addEventListener("change", () => {
  const number = $("#kernel-size input").value;
  if (chosenKernel) say("choose", {kernel: number ? `${chosenKernel.name}-${number}` : chosenKernel.name});
});
$("#reset").addEventListener("click", () => { camera.started = false; say("reset"); });
