#!/usr/bin/env node
// SPDX-License-Identifier: BSD-3-Clause
// PlayCanvas: the volumetric fog of a CameraFrame, read before tone mapping. See README.md.
//
//   airlight capture playcanvas sphere-spot -o x.exr --set localSteps=32
//
// A lamp adds the sum over steps of
//
//   tint density c 16/(r^2 + 1) (1 - (r/range)^4)^2 edge V p exp(-extinction depth) dt,
//
// and a surface has the same law without the 1/pi of its reflection. With intensity I/16 and
// reflectance/pi these are the numbers of physics, but for the law, the window, the edge, and the
// way from the light.
import { Refused, short } from './scene.mjs';

const SUN = 'directional';
const STEPLESS = 0.01; // a smoothstep needs a width [degrees]

/** The settings of the engine by its own names, as far as it has them. */
const settings = ({ far }) => ({
  steps: 128,
  localSteps: 64, // of suns and of lamps: the most that the engine takes
  scale: 1, // fog at the resolution of the image; the engine begins with 0.5
  range: short(4 * far), // where the light of lamps ends [m]
  maxDistance: far, // where the fog ends [m]
  extinction: 1,
  shadows: 1,
  shadowResolution: 2048,
  shadowType: 'PCF1_32F',
  shadowBias: 0.15, // it belongs to the range: less gives acne, more takes shadows from the fog
  nearClip: 0.02,
  frames: 2,
  // 1 gives intensities below 1 as they are, as a user types them: the engine decodes them as colours
  plainIntensity: 0,
});

function refusalOf({ described, lights, medium, hulls }) {
  if (hulls.length) return 'its fog has no bounds';
  if (medium.layers) {
    const own = medium.engines.playcanvas;
    if (own.cannot) return `its height fog cannot be that of the scene: ${own.cannot}`;
    if (medium.up !== described.up)
      return `heights are along the axis that is up in the image; here they are along ${medium.up}`;
  } else if (new Set(medium.sigma_t).size > 1) {
    return 'its fog has one extinction for all colours; expected a grey one';
  }
  const { name, g = 0 } = medium.phase;
  if (!['isotropic', 'hg'].includes(name))
    return `its phase function is Henyey-Greenstein's; got ${name}`;
  if (g < 0 || g > 0.95) return `its anisotropy is from 0 to 0.95; got ${g}`;
  if (lights.filter(light => light.kind === SUN).length > 1) return 'its fog has one sun';
}

/** Return the equation as terms of `airlight compare --model`; undefined where no term says it. */
function model(scene, { range, maxDistance, extinction, shadows, plainIntensity }) {
  if (!shadows || plainIntensity) return undefined;
  const path = extinction === 1 ? '' : `camera-path=${extinction},`;
  const lamps = `law=softened:1,range=quartic:${range},spot=cosine-smooth`;
  return `light-path=off,${path}${lamps},ends=spheres:0:${maxDistance}`;
}

async function render({ camera, lights, meshes, medium }, options, edits, canvas) {
  const pc = await import('playcanvas');
  const device = await pc.createGraphicsDevice(canvas, {
    deviceTypes: ['webgl2'],
    antialias: false,
  });
  const setup = new pc.AppOptions();
  setup.graphicsDevice = device;
  setup.componentSystems = [
    pc.CameraComponentSystem,
    pc.LightComponentSystem,
    pc.RenderComponentSystem,
  ];
  setup.resourceHandlers = [];
  const app = new pc.AppBase(canvas);
  app.init(setup);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, camera.width, camera.height);
  app.start();
  const shadowType = pc[`SHADOW_${options.shadowType}`];
  if (shadowType === undefined)
    throw new Refused(`shadowType: there is no SHADOW_${options.shadowType}`);
  app.scene.ambientLight = new pc.Color(0, 0, 0);
  app.scene.clusteredLightingEnabled = true;
  Object.assign(app.scene.lighting, {
    shadowsEnabled: !!options.shadows,
    shadowAtlasResolution: options.shadowResolution,
    shadowType,
  });

  const eye = new pc.Entity();
  eye.addComponent('camera', {
    clearColor: new pc.Color(0, 0, 0, 1),
    nearClip: options.nearClip,
    farClip: 2 * options.maxDistance,
    fov: camera.fovY,
    toneMapping: pc.TONEMAP_NONE,
    gammaCorrection: pc.GAMMA_NONE,
  });
  eye.setPosition(...camera.position);
  eye.lookAt(...camera.position.map((x, k) => x + camera.forward[k]), ...camera.up);
  app.root.addChild(eye);

  // Colours of lights and materials are decoded by a gamma of 2.2, and so is an intensity below 1;
  // the tint of fog is not.
  const encoded = values => new pc.Color(...values.map(x => Math.pow(x, 1 / 2.2)));
  let sun = null;
  for (const light of lights) {
    const wanted = light.color.map(x => (light.kind === SUN ? x : x / 16)),
      intensity = Math.max(options.plainIntensity ? 0 : 1, ...wanted);
    const entity = new pc.Entity();
    entity.addComponent('light', {
      type: { point: 'omni', spot: 'spot', [SUN]: SUN }[light.kind],
      color: encoded(wanted.map(x => x / intensity)),
      intensity,
      range: options.range,
      falloffMode: pc.LIGHTFALLOFF_INVERSESQUARED,
      castShadows: !!options.shadows,
      shadowBias: options.shadowBias,
      normalOffsetBias: 0,
      shadowType,
      shadowResolution: options.shadowResolution,
      shadowDistance: 2 * options.maxDistance,
      numCascades: 1,
      ...(light.kind === 'spot' && {
        outerConeAngle: light.cutoff,
        innerConeAngle: Math.min(light.beam, light.cutoff - STEPLESS),
      }),
    });
    entity.setPosition(...light.position);
    if (light.kind !== 'point') {
      // lights shine along their -y
      const turn = new pc.Quat();
      turn.setFromDirections(new pc.Vec3(0, -1, 0), new pc.Vec3(...light.axis));
      entity.setRotation(turn);
    }
    app.root.addChild(entity);
    if (light.kind === SUN) sun = entity.light;
  }

  const materials = [];
  const solid = ({ positions, normals, reflectance, two_sided: twoSided }) => {
    const mesh = new pc.Mesh(device),
      material = new pc.StandardMaterial(),
      entity = new pc.Entity();
    mesh.setPositions(positions);
    mesh.setNormals(normals);
    mesh.update();
    material.specular = new pc.Color(0, 0, 0);
    material.twoSidedLighting = twoSided;
    material.cull = twoSided ? pc.CULLFACE_NONE : pc.CULLFACE_BACK;
    entity.addComponent('render', {
      meshInstances: [new pc.MeshInstance(mesh, material)],
      castShadows: true,
    });
    app.root.addChild(entity);
    materials.push([material, encoded(reflectance.map(x => x / Math.PI))]);
  };
  meshes.forEach(solid);
  if (!meshes.length) {
    // Without a mesh in view the engine makes no clusters of lights: a speck behind the fog.
    const at = camera.position.map((x, k) => x + 1.5 * options.maxDistance * camera.forward[k]);
    const positions = new Float32Array(
      [0, 1, 2].flatMap(i => at.map((x, k) => x + (i === k ? 1e-3 : 0))),
    );
    solid({
      positions,
      normals: new Float32Array([0, 1, 0, 0, 1, 0, 0, 1, 0]),
      reflectance: [0, 0, 0],
      two_sided: true,
    });
  }

  const frame = new pc.CameraFrame(app, eye.camera);
  Object.assign(frame.rendering, {
    toneMapping: pc.TONEMAP_NONE,
    renderFormats: [pc.PIXELFORMAT_RGBA32F],
    samples: 1,
  });
  const { tint, ...fog } = fogOf(medium);
  Object.assign(frame.volumetricFog, {
    enabled: true,
    light: sun,
    localOmniLights: true,
    localSpotLights: true,
    ...fog,
    tint: new pc.Color(...tint),
    extinction: options.extinction,
    intensity: 1,
    localIntensity: 1,
    ambientIntensity: 0,
    maxDistance: options.maxDistance,
    steps: options.steps,
    localSteps: options.localSteps,
    scale: options.scale,
  });

  // The frame has set its chunks, and compiles them when it first draws.
  frame.update();
  const chunks = pc.ShaderChunks.get(device, pc.SHADERLANGUAGE_GLSL);
  for (const [name, from, to] of edits) {
    const text = chunks.get(name);
    if (text === undefined) throw new Refused(`edit: there is no shader chunk '${name}'`);
    if (!text.includes(from))
      throw new Refused(`edit: the shader chunk '${name}' does not contain '${from}'`);
    chunks.set(name, text.replaceAll(from, to));
  }

  /** Draw frames, with black surfaces or not; return the image before it has 8 bits. */
  const drawn = async black => {
    for (const [material, diffuse] of materials) {
      material.diffuse = black ? new pc.Color(0, 0, 0) : diffuse;
      material.update();
    }
    frame.update();
    for (let i = 0; i < options.frames; i++) await new Promise(done => app.once('frameend', done));
    const pass = frame.renderPassCamera,
      texture = pass.sceneTexture;
    return new Float32Array(
      await texture.read(0, 0, texture.width, texture.height, {
        renderTarget: pass.rt,
        immediate: true,
      }),
    );
  };
  const all = await drawn(false),
    airlight = await drawn(true);
  return { airlight, surface: all.map((x, i) => x - airlight[i]) };
}

/** Return the engine's numbers of a medium: density, layer, and the albedo as a tint. */
function fogOf(medium) {
  const {
    density,
    heightFalloff = 0,
    heightBase = 0,
  } = medium.layers ? medium.engines.playcanvas.parameters : { density: medium.sigma_t[0] };
  const tint = medium.layers ? medium.albedo : medium.sigma_s.map(x => x / density);
  return { density, heightFalloff, heightBase, anisotropy: medium.phase.g ?? 0, tint };
}

const adapter = {
  engine: 'PlayCanvas',
  package: 'playcanvas',
  imports: { playcanvas: 'playcanvas/build/playcanvas.mjs' },
  edits: true,
  settings,
  refusal: refusalOf,
  model,
  render,
};
export default adapter;
if (typeof document === 'undefined')
  await (await import('./browser.mjs')).run(import.meta.url, adapter);
