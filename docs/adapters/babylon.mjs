#!/usr/bin/env node
// SPDX-License-Identifier: BSD-3-Clause
// Babylon.js: the volumetric lighting of a frame graph, which has one sun. See README.md.
//
//   airlight capture babylon windows -o x.exr --set tesselation=2048
//
// The engine makes a mesh of a shadow map: from the near plane of the sun's frustum to where its
// light ends. A face at the distance x adds or subtracts lightPower p x, and their sum is the way
// of a ray through lit fog. That fog has no bounds. Here it is the difference of two volumes, which
// end where light leaves the bounds and where it enters them; fog without bounds is a ball about
// the camera.
import { Refused, inside } from './scene.mjs';

const SHADER = 'volumetricLightingRenderVolumePixelShader';
const MARGIN = 0.01; // of the sun's frustum, in its width

const settings = ({ far }) => ({
  mapSize: 4096,
  tesselation: 1024, // of a volume; the engine begins with 64
  enableExtinction: 0, // on the way to the camera
  finer: 3, // of so many by so many pixels of fog the middle one is kept
  far, // radius of the ball of fog about the camera [m]
  bias: 0.001, // of the shadows on surfaces
  minZ: 0.02,
});

function refusal({ camera, lights, medium, hulls }, { enableExtinction, finer }) {
  if (!medium.sigma_s) return 'the adapter brings homogeneous fog alone';
  if (lights.some(light => light.kind !== 'directional')) return 'its fog has no lamps';
  if (lights.length > 1) return 'its fog has one sun';
  const { name } = medium.phase;
  if (!['isotropic', 'hg'].includes(name))
    return `its phase function is Henyey-Greenstein's; got ${name}`;
  // All of the way from the camera counts.
  if (enableExtinction && hulls.some(hull => !inside(hull, camera.position)))
    return 'enableExtinction: its fog begins at the camera; that of the scene has bounds before it';
  if (finer % 2 !== 1) return `finer: got ${finer}, expected 1, 3, 5 or so`;
}

/** Return the equation as terms of `airlight compare --model`. */
function model({ hulls }, { enableExtinction, far }) {
  const way = enableExtinction ? 'surface.camera-path=off' : 'camera-path=off';
  return `light-path=off,${way}${hulls.length ? '' : `,ends=spheres:0:${far}`}`;
}

async function render({ camera, lights, meshes, medium, hulls }, options, edits, canvas) {
  const babylon = await modules();
  edits.forEach(edit => change(babylon.ShaderStore, ...edit));
  // With extinction the task wants a kind of blending that is missing here. Its fog does not.
  if (options.enableExtinction)
    change(babylon.ShaderStore, SHADER, '#ifdef USE_EXTINCTION', '#ifndef USE_EXTINCTION');
  const engine = new babylon.Engine(canvas, false, { antialias: false });
  const sun = { ...lights[0], brightest: Math.max(...lights[0].color) };
  const given = { babylon, engine, camera, sun, meshes, medium, options };

  const none = () => new Float32Array(4 * camera.width * camera.height);
  const surface = meshes.length ? await drawn(given, meshes) : none();
  const bounds = hulls.length ? hulls : [ball(camera.position, options.far)];
  const part = sign => bounds.map(hull => facing(hull, sign, sun.axis));
  const before = await drawn(given, bounds, part(-1)),
    behind = await drawn(given, bounds, part(1));
  return {
    airlight: behind.map((x, i) => Math.max(0, x - before[i])),
    surface: surface.map(x => x * sun.brightest),
  };
}

/** Return what the engine exports, by its own names. */
async function modules() {
  const tasks = 'FrameGraph/Tasks';
  const places = [
    'Engines/engine',
    'Engines/constants',
    'Engines/shaderStore',
    'Engines/Extensions/engine.multiRender',
    'Engines/Extensions/engine.readTexture',
    'scene',
    'Cameras/freeCamera',
    'Maths/math.vector',
    'Maths/math.color',
    'Meshes/mesh',
    'Meshes/mesh.vertexData',
    'Lights/directionalLight',
    'Lights/Shadows/shadowGenerator',
    'Lights/Shadows/shadowGeneratorSceneComponent',
    'Materials/standardMaterial',
    'FrameGraph/frameGraph',
    `${tasks}/Texture/clearTextureTask`,
    `${tasks}/Texture/copyToTextureTask`,
    `${tasks}/Rendering/objectRendererTask`,
    `${tasks}/Rendering/shadowGeneratorTask`,
    `${tasks}/Misc/lightingVolumeTask`,
    `${tasks}/PostProcesses/volumetricLightingTask`,
    'Shaders/volumetricLightingRenderVolume.vertex',
    'Shaders/volumetricLightingRenderVolume.fragment',
  ];
  const found = await Promise.all(places.map(place => import(`@babylonjs/core/${place}.js`)));
  return Object.assign({}, ...found);
}

function change({ ShadersStore }, name, from, to) {
  const text = ShadersStore[name];
  if (text === undefined) throw new Refused(`edit: there is no shader chunk '${name}'`);
  if (!text.includes(from))
    throw new Refused(`edit: the shader chunk '${name}' does not contain '${from}'`);
  ShadersStore[name] = text.replaceAll(from, to);
}

/**
 * Return an image: of the surfaces, or of the light before them and before `ends`.
 *
 * `held`: the meshes that the sun's frustum holds to its sides.
 */
async function drawn({ babylon, engine, camera, sun, meshes, medium, options }, held, ends) {
  const scene = new babylon.Scene(engine);
  scene.ambientColor = new babylon.Color3(0, 0, 0);
  scene.imageProcessingConfiguration.isEnabled = false; // it decodes colours by a gamma of 2.2
  const eye = new babylon.FreeCamera('eye', vector(babylon, camera.position), scene);
  eye.upVector = vector(babylon, camera.up);
  eye.setTarget(vector(babylon, along(camera.position, camera.forward)));
  eye.fov = (camera.fovY * Math.PI) / 180;
  scene.activeCamera = eye;

  const solid = ({ positions, normals, reflectance = [0, 0, 0], two_sided: twoSided = true }) => {
    const mesh = new babylon.Mesh('mesh', scene),
      data = new babylon.VertexData(),
      material = new babylon.StandardMaterial('material', scene);
    data.positions = mirrored(positions);
    data.normals = mirrored(normals);
    data.indices = Uint32Array.from({ length: positions.length / 3 }, (_, i) => i);
    data.applyToMesh(mesh);
    material.diffuseColor = new babylon.Color3(...reflectance.map(x => x / Math.PI));
    material.specularColor = new babylon.Color3(0, 0, 0);
    material.backFaceCulling = !twoSided;
    material.twoSidedLighting = twoSided;
    mesh.material = material;
    mesh.receiveShadows = true;
    return mesh;
  };
  const things = meshes.map(solid),
    casters = [...things, ...(ends ?? []).map(solid)];

  // The sun's frustum has what is `held` and in view to its sides, and all casters along its light.
  const light = new babylon.DirectionalLight('sun', vector(babylon, sun.axis), scene);
  light.position = new babylon.Vector3(0, 0, 0);
  // Surfaces are clamped at 1: what is brightest of the sun is for the caller.
  light.diffuse = new babylon.Color3(...sun.color.map(x => x / sun.brightest));
  const { Matrix, Vector3 } = babylon;
  const turn = Matrix.LookAtLH(light.position, light.direction, Vector3.UpReadOnly);
  const [low, high] = boxOf(babylon, held, turn),
    [left, right] = boxOf(babylon, [seen(camera, held)], turn),
    [first, last] = boxOf(babylon, [...meshes, ...held], turn);
  const margin = MARGIN * Math.max(high[0] - low[0], high[1] - low[1]);
  Object.assign(light, {
    autoUpdateExtends: false,
    shadowOrthoScale: 0, // or the volume's sides do not stand where its end does
    orthoLeft: Math.max(low[0], left[0]) - margin,
    orthoRight: Math.min(high[0], right[0]) + margin,
    orthoBottom: Math.max(low[1], left[1]) - margin,
    orthoTop: Math.min(high[1], right[1]) + margin,
    shadowMinZ: first[2] - margin,
    shadowMaxZ: last[2] + margin,
  });
  // All of the volume is between the clip planes, the camera somewhere in or about it.
  eye.minZ = options.minZ;
  eye.maxZ = [0, 1, 2].reduce((sum, k) => sum + last[k] - first[k], 2 * options.far);

  const graph = new babylon.FrameGraph(scene, false),
    textures = graph.textureManager;
  scene.frameGraph = graph;
  const fine = ends ? options.finer : 1;
  const size = { width: camera.width * fine, height: camera.height * fine };
  const texture = (label, format) =>
    textures.createRenderTargetTexture(label, {
      size,
      sizeIsPercentage: false,
      options: {
        createMipMaps: false,
        types: [babylon.Constants.TEXTURETYPE_FLOAT],
        formats: [babylon.Constants[`TEXTUREFORMAT_${format}`]],
        samples: 1,
        useSRGBBuffers: [false],
        labels: [label],
      },
    });
  const task = (Kind, values, ...more) => {
    const made = Object.assign(new Kind(Kind.name, graph, ...more), values);
    graph.addTask(made);
    return made;
  };
  const clear = task(babylon.FrameGraphClearTextureTask, {
    clearColor: true,
    clearDepth: true,
    color: new babylon.Color4(0, 0, 0, 1),
    targetTexture: texture('image', 'RGBA'),
    depthTexture: texture('depth', 'DEPTH32_FLOAT'),
  });
  const { FILTER_PCF, FILTER_NONE } = babylon.ShadowGenerator;
  const shadow = task(babylon.FrameGraphShadowGeneratorTask, {
    mapSize: options.mapSize,
    useFloat32TextureType: true,
    filter: ends ? FILTER_PCF : FILTER_NONE, // the volume takes the depth that PCF has
    bias: ends ? 0 : options.bias, // it would move the volume
    objectList: { meshes: casters, particleSystems: null },
    camera: eye,
    light,
  });
  const draw = task(
    babylon.FrameGraphObjectRendererTask,
    {
      targetTexture: clear.outputTexture,
      depthTexture: clear.outputDepthTexture,
      objectList: { meshes: things, particleSystems: null },
      camera: eye,
      shadowGenerators: [shadow],
      isMainObjectRenderer: true,
    },
    scene,
  );
  let result = draw.outputTexture,
    volume;
  if (ends) {
    const black = new babylon.Color3(0, 0, 0);
    for (const { material } of things) material.diffuseColor = black;
    const made = task(babylon.FrameGraphLightingVolumeTask, { shadowGenerator: shadow });
    volume = made.lightingVolume;
    volume.tesselation = options.tesselation;
    result = task(babylon.FrameGraphVolumetricLightingTask, {
      targetTexture: draw.outputTexture,
      depthTexture: draw.outputDepthTexture,
      lightingVolumeMesh: made.outputMeshLightingVolume,
      camera: eye,
      light,
      lightPower: new babylon.Color3(...sun.color.map((x, k) => x * medium.sigma_s[k])),
      extinction: new babylon.Vector3(...medium.sigma_t),
      phaseG: medium.phase.g ?? 0,
    }).outputTexture;
  }
  task(babylon.FrameGraphCopyToTextureTask, { sourceTexture: result, targetTexture: 0 });
  await graph.buildAsync();

  // The volume comes frames after the shadow map, and is made twice: of one that is surely there.
  const frame = async () => {
    await new Promise(requestAnimationFrame);
    scene.render();
  };
  await frame();
  for (let i = 0; volume && i < 2; i++) {
    volume.frequency = 0; // once more, then no more
    while (volume.firstUpdate) await frame();
  }
  await frame();
  const { width, height } = size;
  const pixels = await engine._readTexturePixels(
    textures.getTextureFromHandle(result),
    width,
    height,
  );
  const image = middle(new Float32Array(pixels), size, fine);
  scene.dispose();
  return image;
}

/** Return the middle one of every `fine` by `fine` pixels, RGBA. */
function middle(pixels, { width, height }, fine) {
  const half = (fine - 1) / 2,
    out = [];
  for (let j = half; j < height; j += fine)
    for (let i = half; i < width; i += fine) out.push(pixels.subarray(4 * (j * width + i)));
  return Float32Array.from({ length: 4 * out.length }, (_, i) => out[i >> 2][i & 3]);
}

const along = (point, direction, by = 1) => [0, 1, 2].map(k => point[k] + by * direction[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) =>
  [0, 1, 2].map(k => a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
const vector = ({ Vector3 }, [x, y, z]) => new Vector3(x, y, -z); // the engine is left-handed
const mirrored = list => list.map((x, i) => (i % 3 === 2 ? -x : x));

/** Return the faces of a mesh that look along an axis (a positive `sign`) or against it. */
function facing({ positions, normals }, sign, axis) {
  const faces = [];
  for (let i = 0; i < positions.length; i += 9) {
    const [a, b, c] = [0, 3, 6].map(k => positions.subarray(i + k, i + k + 3)),
      outward = normals.subarray(i, i + 3);
    // Normals may be smooth: the plane says where a face looks, and its normals which side is out.
    const plane = cross(along(b, a, -1), along(c, a, -1));
    if (sign * dot(plane, axis) * dot(plane, outward) > 0) faces.push(i);
  }
  const of = list => Float32Array.from(faces.flatMap(i => [...list.subarray(i, i + 9)]));
  return { positions: of(positions), normals: of(normals) };
}

/** Return a box about meshes, as its lowest and its highest corner, in the space of a matrix. */
function boxOf(babylon, meshes, matrix) {
  const low = [Infinity, Infinity, Infinity],
    high = [-Infinity, -Infinity, -Infinity];
  for (const { positions } of meshes)
    for (let i = 0; i < positions.length; i += 3) {
      const point = vector(babylon, positions.subarray(i, i + 3));
      const place = babylon.Vector3.TransformCoordinates(point, matrix).asArray();
      place.forEach((x, k) => {
        low[k] = Math.min(low[k], x);
        high[k] = Math.max(high[k], x);
      });
    }
  return [low, high];
}

/** Return the points of what is in view, as far as the farthest corner of meshes, as positions. */
function seen({ position, forward, up, fovY, width, height }, meshes) {
  const distance = ({ positions: list }, i) =>
    Math.hypot(...position.map((x, k) => list[i + k] - x));
  let far = 0;
  for (const mesh of meshes)
    for (let i = 0; i < mesh.positions.length; i += 3) far = Math.max(far, distance(mesh, i));
  const right = cross(forward, up);
  const tall = Math.tan((fovY * Math.PI) / 360),
    wide = (tall * width) / height;
  const points = [...position];
  for (let i = -16; i <= 16; i++)
    for (let j = -16; j <= 16; j++) {
      const ray = along(along(forward, right, (wide * i) / 16), up, (tall * j) / 16);
      points.push(...along(position, ray, far / Math.hypot(...ray)));
    }
  return { positions: new Float32Array(points) };
}

/** Return a ball of flat faces. */
function ball(centre, radius) {
  const positions = [],
    normals = [];
  const [turns, rows] = [256, 128];
  const unit = (i, j) => {
    const [a, b] = [(2 * Math.PI * i) / turns, (Math.PI * j) / rows];
    return [Math.sin(b) * Math.cos(a), Math.cos(b), -Math.sin(b) * Math.sin(a)];
  };
  const face = corners => {
    const sum = corners.reduce((all, corner) => along(all, corner));
    for (const corner of corners) {
      positions.push(...along(centre, corner, radius));
      normals.push(...sum);
    }
  };
  for (let i = 0; i < turns; i++)
    for (let j = 0; j < rows; j++) {
      const corners = [unit(i, j), unit(i, j + 1), unit(i + 1, j + 1), unit(i + 1, j)];
      if (j < rows - 1) face([corners[0], corners[1], corners[2]]);
      if (j > 0) face([corners[0], corners[2], corners[3]]);
    }
  return { positions: new Float32Array(positions), normals: new Float32Array(normals) };
}

const adapter = {
  engine: 'Babylon.js',
  package: '@babylonjs/core',
  imports: { '@babylonjs/core/': '@babylonjs/core/' },
  edits: true,
  settings,
  refusal,
  model,
  render,
};
export default adapter;
if (typeof document === 'undefined')
  await (await import('./browser.mjs')).run(import.meta.url, adapter);
