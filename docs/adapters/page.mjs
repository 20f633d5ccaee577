// SPDX-License-Identifier: BSD-3-Clause
// Runs in the browser: imports the adapter, lets it render, and posts its layers to `browser.mjs`.
import { sceneOf } from './scene.mjs';

const problems = [];
const tell = (name, body) => fetch(name, { method: 'POST', body });

function failed(error) {
  if (error?.refused) return tell('/refused', error.message);
  const words = String(error?.stack ?? error?.message ?? error);
  return tell('/failed', [words, ...problems].join('\n'));
}

for (const kind of ['warn', 'error'])
  console[kind] = (...words) => problems.push(words.map(String).join(' ').slice(0, 300));
addEventListener('error', event => failed(event.error ?? event.message));
addEventListener('unhandledrejection', event => failed(event.reason));

/** Return what draws: the version of Chromium, and its renderer. */
async function device() {
  const agent = await navigator.userAgentData.getHighEntropyValues(['fullVersionList']);
  const { version } = agent.fullVersionList.find(({ brand }) => brand === 'Chromium');
  const gl = document.createElement('canvas').getContext('webgl2');
  const { UNMASKED_RENDERER_WEBGL: name } = gl?.getExtension('WEBGL_debug_renderer_info') ?? {};
  return `WebGL2 of Chromium ${version}, ${name ? gl.getParameter(name) : 'unknown'}`;
}

async function main() {
  const given = async name => fetch(`/given/${name}`);
  const { file, settings, edits } = await (await given('words')).json();
  const { default: adapter } = await import(`/adapters/${file}`);
  const scene = sceneOf(
    await (await given('json')).json(),
    await (await given('glb')).arrayBuffer(),
  );
  const canvas = document.getElementById('canvas');
  canvas.width = scene.camera.width;
  canvas.height = scene.camera.height;
  const layers = await adapter.render(scene, settings, edits, canvas);
  for (const [name, image] of Object.entries(layers)) await tell(`/layer/${name}`, image);
  await tell('/done', JSON.stringify({ device: await device(), problems: problems.slice(0, 5) }));
}

main().catch(failed);
