// SPDX-License-Identifier: BSD-3-Clause
// Runs the adapter of an engine for browsers, in node: reads the scene, serves a page to Chromium
// without a window, waits for its images and writes them. `README.md` has the contract; an adapter
// calls `run` at its end.
//
// WebGL runs on SwiftShader, on the processor: seconds say nothing about the speed of an engine.
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { exr } from './exr.mjs';
import { Ended, FAILED, HERE, WRONG, findChromium, installed, isRoot } from './programs.mjs';
import { refusal, sceneOf } from './scene.mjs';

const TYPES = { '.mjs': 'text/javascript', '.js': 'text/javascript', '.json': 'application/json' };
const FLAGS = [
  '--headless',
  '--remote-debugging-pipe', // it ends when the pipe ends
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
  '--ignore-gpu-blocklist',
  '--disable-dev-shm-usage',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-breakpad',
  '--no-proxy-server',
  '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1', // nothing else is reached
  ...(isRoot ? ['--no-sandbox'] : []),
];

const refused = words => new Ended(WRONG, words);

/** Run an adapter, the default export of `file`, by the words of the command line, and end. */
export async function run(file, adapter) {
  let status = 0;
  try {
    const name = path.basename(fileURLToPath(file));
    console.log(JSON.stringify(await capture(name, adapter, process.argv.slice(2))));
  } catch (error) {
    // One line, and of a fault the places where it lies.
    const words = String(error instanceof Ended ? error.message : (error.stack ?? error));
    const lines = words.split('\n').map(line => line.trim());
    console.error(lines.filter(Boolean).slice(0, 4).join(' | ').slice(0, 1500));
    status = error.status ?? FAILED;
  }
  process.exit(status);
}

async function capture(file, adapter, [json, glb, output, ...words]) {
  const began = performance.now();
  const passed = () => (performance.now() - began) / 1000;
  if (!output) throw refused(`expected ${file} SCENE.json SCENE.glb OUT.exr NAME=VALUE...`);
  // A scene that the engine cannot have is refused before anything starts.
  const data = new Uint8Array(fs.readFileSync(glb)).buffer;
  const scene = sceneOf(JSON.parse(fs.readFileSync(json, 'utf8')), data);
  const { settings, edits } = read(adapter, scene, words);
  const why = refusal(scene) ?? adapter.refusal(scene, settings);
  if (why) throw refused(`${adapter.engine}: ${why}`);
  const chromium = findChromium();
  // A fifth of the time is left to say what did not come.
  const seconds = 0.8 * Number(process.env.AIRLIGHT_LIMIT ?? 300);
  const packages = installed(seconds);
  const list = path.join(packages, adapter.package, 'package.json');
  const { version } = JSON.parse(fs.readFileSync(list, 'utf8'));
  const given = { json, glb, words: JSON.stringify({ file, settings, edits }) };
  const page = new Page(adapter, packages, given);
  const { device, problems } = await page.result(chromium, seconds - passed());
  fs.writeFileSync(output, exr(page.layers(scene.camera), scene.camera.width, scene.camera.height));
  return {
    engine: adapter.engine,
    version,
    device,
    settings,
    pixel: 'centre',
    // An edited shader solves an equation that nobody knows here.
    ...(edits.length ? {} : { model: adapter.model(scene, settings) }),
    seconds: Math.round(1000 * passed()) / 1000,
    problems,
  };
}

/** Return the settings, those of the adapter with the user's values, and the edits of shaders. */
function read(adapter, scene, words) {
  const settings = { ...adapter.settings(scene) };
  const edits = [];
  for (const word of words) {
    const [name, ...rest] = word.split('=');
    const value = rest.join('=');
    if (name === 'edit') edits.push(edit(adapter, value));
    else if (!Object.hasOwn(settings, name))
      throw refused(
        `${adapter.engine} has no setting '${name}' here; it has ` +
          Object.keys(settings).join(', '),
      );
    else if (typeof settings[name] !== 'number') settings[name] = value;
    else if (value.trim() && Number.isFinite(Number(value))) settings[name] = Number(value);
    else throw refused(`${name}: got '${value}', expected a number`);
  }
  return { settings, edits };
}

function edit(adapter, value) {
  const [chunk, from, to, ...more] = value.split('~');
  if (!adapter.edits) throw refused(`${adapter.engine}: it has no shader chunks to edit`);
  if (!chunk || !from || to === undefined || more.length)
    throw refused(`edit: got '${value}', expected CHUNK~FROM~TO`);
  return [chunk, from, to];
}

/** The page in which an adapter renders, and the server that it talks to. */
class Page {
  #images = {};

  constructor(adapter, packages, given) {
    Object.assign(this, { adapter, given, roots: { adapters: HERE, packages } });
    this.told = new Promise((done, failed) => Object.assign(this, { done, failed }));
    this.told.catch(() => {}); // it may fail before anybody waits
  }

  fail(words, status = FAILED) {
    this.failed(new Ended(status, `${this.adapter.engine}: ${words}`));
  }

  /** Return what the page says when it is done, once a browser was started and has ended. */
  async result(chromium, seconds) {
    const profile = fs.mkdtempSync(path.join(os.tmpdir(), 'page-'));
    const server = http.createServer((request, response) => this.#answer(request, response));
    const timer = setTimeout(
      () => this.fail(`no result within ${seconds.toFixed(0)} s`),
      1000 * seconds,
    );
    let browser;
    try {
      await new Promise((done, failed) => server.on('error', failed).listen(0, '127.0.0.1', done));
      const address = `http://127.0.0.1:${server.address().port}/`;
      browser = spawn(chromium, [...FLAGS, `--user-data-dir=${profile}`, address], {
        stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'],
        env: { ...process.env, HOME: profile, TMPDIR: profile },
      });
      for (const stream of browser.stdio.slice(3)) stream.on('error', () => {});
      browser.on('error', error => this.fail(`Chromium does not start: ${error.message}`));
      browser.on('exit', (code, signal) =>
        this.fail(`Chromium ended with ${signal ?? `the status ${code}`}`),
      );
      return await this.told;
    } finally {
      clearTimeout(timer);
      await ended(browser);
      server.closeAllConnections();
      server.close();
      await remove(profile);
    }
  }

  #answer(request, response) {
    const name = decodeURIComponent(new URL(request.url, 'http://x').pathname);
    const [, root, ...rest] = name.split('/');
    if (request.method === 'POST') return this.#receive(request, response, root, rest[0]);
    const send = (type, text) => response.writeHead(200, { 'Content-Type': type }).end(text);
    if (name === '/favicon.ico') return response.writeHead(204).end();
    if (name === '/') return send('text/html', this.#html());
    if (name === '/given/words') return send(TYPES['.json'], this.given.words);
    const file =
      root === 'given' ? this.given[rest[0]] : path.join(this.roots[root] ?? '/nowhere', ...rest);
    if (!file || !fs.existsSync(file)) {
      // Browsers tell a page nothing of a module that is not there.
      this.fail(`the page asked for ${name}, which is not there`);
      return response.writeHead(404).end();
    }
    const type = TYPES[path.extname(file)] ?? 'application/octet-stream';
    fs.createReadStream(file).pipe(response.writeHead(200, { 'Content-Type': type }));
  }

  async #receive(request, response, kind, layer) {
    const parts = [];
    for await (const part of request) parts.push(part);
    const data = Buffer.concat(parts);
    response.writeHead(204).end();
    if (kind === 'layer') this.#images[layer] = data;
    else if (kind === 'failed') this.fail(data.toString());
    else if (kind === 'refused') this.fail(data.toString(), WRONG);
    else this.done(JSON.parse(data));
  }

  #html() {
    const imports = Object.entries(this.adapter.imports);
    const map = Object.fromEntries(imports.map(([name, place]) => [name, `/packages/${place}`]));
    return `<!doctype html><meta charset="utf-8"><canvas id="canvas"></canvas>
<script type="importmap">${JSON.stringify({ imports: map })}</script>
<script type="module" src="/adapters/page.mjs"></script>`;
  }

  /** Return the layers as planes R, G, B with rows from above; those of WebGL come from below. */
  layers({ width, height }) {
    const planes = data => {
      const values = new Float32Array(new Uint8Array(data).buffer);
      if (values.length !== 4 * width * height)
        throw new Ended(FAILED, `the page gave ${values.length} numbers, not RGBA of the size`);
      return [0, 1, 2].map(k =>
        Float32Array.from({ length: width * height }, (_, i) => {
          const row = height - 1 - Math.floor(i / width);
          return values[4 * (row * width + (i % width)) + k];
        }),
      );
    };
    const images = Object.entries(this.#images);
    return Object.fromEntries(images.map(([name, data]) => [name, planes(data)]));
  }
}

/** Remove a folder, in which processes of a browser that has ended may still write for a moment. */
async function remove(folder) {
  for (let i = 0; i < 20; i++)
    try {
      return fs.rmSync(folder, { recursive: true, force: true });
    } catch {
      await new Promise(done => setTimeout(done, 100));
    }
}

async function ended(browser) {
  if (!browser?.pid || browser.exitCode !== null || browser.signalCode) return;
  const gone = new Promise(done => browser.on('exit', done));
  browser.kill();
  const timer = setTimeout(() => browser.kill('SIGKILL'), 3000);
  await gone;
  clearTimeout(timer);
}
