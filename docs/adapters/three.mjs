#!/usr/bin/env node
// SPDX-License-Identifier: BSD-3-Clause
// three.js: the VolumeNodeMaterial, in the limit of dark lights. See README.md.
//
//   airlight capture three open-fog -o x.exr --set steps=1024
//
// With q = 0.01 node sum I/max(r^2, 0.01) edge V the material adds 1 - exp(-int q dx): its light is
// its density. Lights that are `dim` times as bright, and an image divided by `dim`, leave
// int q dx. The node is 100 sigma_s, and lights are I/(4 pi), as there is no phase function: that
// is isotropic scattering, and nothing is attenuated.
import { inside } from './scene.mjs';

const SCALE = 100; // the engine's 0.01
const STEPLESS = 0.01; // a smoothstep needs a width [degrees]
const RADIUS = 0.1; // where the law is cut [m]

const settings = ({ far }) => ({
  steps: 512,
  dim: 1e-4,
  far, // radius of the ball of fog about the camera [m]
  shadowResolution: 1024,
  bias: -0.001,
  near: 0.02,
});

function refusal({ camera, lights, medium, hulls }) {
  if (!medium.sigma_s) return 'the adapter brings homogeneous fog alone';
  if (lights.some(light => light.kind === 'directional')) return 'its fog has no suns';
  // The engine marches from the back of the hull to the camera, also through what lies outside.
  if (hulls.some(hull => !inside(hull, camera.position)))
    return 'its fog has bounds only where the camera is within them';
}

/** Return the equation as terms of `airlight compare --model`; undefined where lights are not dark. */
function model({ hulls }, { far, dim }) {
  if (dim > 1e-3) return undefined; // 1 - exp(-X) is not X
  const ends = hulls.length ? '' : `,ends=spheres:0:${far}`;
  const terms = `light-path=off,camera-path=off,law=clamped:${RADIUS},spot=cosine-smooth`;
  return `${terms},phase=isotropic${ends}`;
}

async function render({ camera, lights, meshes, medium, hulls }, options, edits, canvas) {
  const THREE = await import('three/webgpu');
  const { Fn, texture, vec3, screenUV } = await import('three/tsl');
  const renderer = new THREE.WebGPURenderer({ canvas, forceWebGL: true });
  await renderer.init();
  renderer.setSize(camera.width, camera.height, false);
  Object.assign(renderer, {
    toneMapping: THREE.NoToneMapping,
    outputColorSpace: THREE.LinearSRGBColorSpace,
  });
  Object.assign(renderer.shadowMap, { enabled: true, type: THREE.BasicShadowMap });

  const eye = new THREE.PerspectiveCamera(
    camera.fovY,
    camera.width / camera.height,
    options.near,
    4 * options.far,
  );
  new THREE.Matrix4().fromArray(camera.matrix).decompose(eye.position, eye.quaternion, eye.scale);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0, 0, 0);
  const shaped = ({ positions, normals }) => {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute('position', new THREE.BufferAttribute(positions, 3));
    return shape.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
  };
  for (const mesh of meshes) {
    const thing = new THREE.Mesh(
      shaped(mesh),
      new THREE.MeshLambertNodeMaterial({
        color: new THREE.Color().setRGB(...mesh.reflectance),
        side: mesh.two_sided ? THREE.DoubleSide : THREE.FrontSide,
      }),
    );
    thing.castShadow = thing.receiveShadow = true;
    scene.add(thing);
  }
  const lamps = [];
  for (const light of lights) {
    const brightest = Math.max(...light.color),
      tint = new THREE.Color().setRGB(...light.color.map(x => x / brightest));
    const beam = Math.min(light.beam, light.cutoff - STEPLESS);
    const lamp =
      light.kind === 'point'
        ? new THREE.PointLight(tint, brightest, 0, 2)
        : new THREE.SpotLight(
            tint,
            brightest,
            0,
            THREE.MathUtils.degToRad(light.cutoff),
            1 - beam / light.cutoff,
            2,
          );
    lamp.position.fromArray(light.position);
    if (lamp.target) {
      lamp.target.position.copy(lamp.position).add(new THREE.Vector3(...light.axis));
      scene.add(lamp.target);
    }
    lamp.castShadow = meshes.length > 0;
    if (lamp.castShadow) {
      lamp.shadow.mapSize.set(options.shadowResolution, options.shadowResolution);
      lamp.shadow.bias = options.bias;
      Object.assign(lamp.shadow.camera, { near: options.near, far: 2 * options.far });
    }
    lamps.push([lamp, brightest]);
    scene.add(lamp);
  }

  const target = more =>
    new THREE.RenderTarget(camera.width, camera.height, {
      type: THREE.FloatType,
      format: THREE.RGBAFormat,
      depthBuffer: true,
      ...more,
    });
  const drawn = async into => {
    renderer.setRenderTarget(into);
    renderer.render(scene, eye);
    renderer.render(scene, eye); // the second has all shadow maps
    return new Float32Array(
      await renderer.readRenderTargetPixelsAsync(into, 0, 0, camera.width, camera.height),
    );
  };
  // First the surfaces, with their depth. The engine does not attenuate them: that is no part of
  // its material.
  const opaque = target({
    depthTexture: new THREE.DepthTexture(camera.width, camera.height, THREE.FloatType),
  });
  const surface = await drawn(opaque);

  // Then the fog alone: a ball about the camera, or the hull of a bounded medium.
  const material = new THREE.VolumeNodeMaterial();
  material.steps = options.steps;
  material.scatteringNode = Fn(() => vec3(...medium.sigma_s.map(x => x * SCALE)));
  if (meshes.length) material.depthNode = texture(opaque.depthTexture, screenUV).r;
  const fog = new THREE.Mesh(
    hulls.length ? shaped(hulls[0]) : new THREE.SphereGeometry(options.far, 256, 128),
    material,
  );
  if (!hulls.length) fog.position.fromArray(camera.position);
  fog.frustumCulled = false;
  for (const thing of scene.children) if (thing.isMesh) thing.layers.set(1);
  scene.add(fog);
  for (const [lamp, brightest] of lamps) {
    lamp.layers.enableAll();
    lamp.shadow?.camera.layers.enableAll();
    lamp.intensity = (brightest * options.dim) / (4 * Math.PI);
  }
  const airlight = await drawn(target());
  return { airlight: airlight.map(x => x / options.dim), surface };
}

const adapter = {
  engine: 'three.js',
  package: 'three',
  settings,
  refusal,
  model,
  render,
  imports: {
    three: 'three/build/three.webgpu.js',
    'three/webgpu': 'three/build/three.webgpu.js',
    'three/tsl': 'three/build/three.tsl.js',
  },
};
export default adapter;
if (typeof document === 'undefined')
  await (await import('./browser.mjs')).run(import.meta.url, adapter);
