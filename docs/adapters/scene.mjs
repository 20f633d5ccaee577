// SPDX-License-Identifier: BSD-3-Clause
// The output of `airlight describe SCENE --json -o SCENE.glb` as arrays for any engine with y up.
// It runs in node and in the browser.

/**
 * Return a scene: numbers of physics from the JSON, places from the glTF file, whose y is up.
 *
 * `camera`, `lights`, `meshes`, `medium` (the first one), `hulls` (the bounds of media), `far` [m],
 * and `described`, the description itself. A mesh has `positions`, `normals` (float32, three
 * corners a triangle), `reflectance`, `two_sided`.
 */
export function sceneOf(json, glb) {
  const described = json.result ?? json;
  const { gltf, blob } = parse(glb);
  const [width, height] = described.camera.size;
  const matrix = gltf.nodes.find(node => node.camera !== undefined).matrix;
  const camera = {
    width,
    height,
    matrix,
    fovY: described.camera.fov_vertical,
    position: matrix.slice(12, 15),
    forward: matrix.slice(8, 11).map(x => -x),
    up: matrix.slice(4, 7),
  };
  // Nodes of lights stand in the order of the description, without area lights.
  const placed = gltf.nodes
    .filter(node => node.extensions?.KHR_lights_punctual)
    .map(node => node.matrix);
  const lights = described.lights
    .filter(light => light.kind !== 'area')
    .map((light, i) => ({
      kind: light.kind,
      color: light.intensity ?? light.irradiance,
      position: placed[i].slice(12, 15),
      axis: placed[i].slice(8, 11).map(x => -x),
      beam: light.beam_angle,
      cutoff: light.cutoff_angle, // half angles [degrees]
    }))
    .filter(light => Math.max(...light.color) > 0);
  const media = described.medium ? [described.medium] : described.bounded_media;
  const bounds = new Set(described.bounded_media.map(medium => medium.name)),
    meshes = [],
    hulls = [];
  for (const node of gltf.nodes.filter(node => node.mesh !== undefined)) {
    const mesh = triangles(gltf, blob, gltf.meshes[node.mesh]);
    const surface = described.surfaces.find(each => each.name === node.name);
    if (bounds.has(node.name)) hulls.push(mesh);
    else if (surface) meshes.push(...sides({ ...mesh, ...surface }));
  }
  return {
    described,
    camera,
    lights,
    meshes,
    hulls,
    medium: media[0],
    far: farthest(camera, lights, meshes, media[0]),
  };
}

/** Return why no engine of a game can have a scene, in words; undefined where it can. */
export function refusal({ described, lights, medium, hulls }) {
  if (!medium || medium.sigma_t?.every(x => x === 0)) return 'the scene has no fog';
  if (medium.voxels) return 'its fog is a density grid, which the adapter does not bring';
  if (described.lights.some(light => light.kind === 'area')) return 'its fog has no area lights';
  if (described.sky) return 'its fog has no sky';
  if (!lights.length) return 'the scene has no light';
  if (described.bounded_media.length > 1 || (described.medium && hulls.length))
    return 'the adapter brings one medium, and the scene has more';
  const odd = described.surfaces.find(surface => surface.textured || !surface.diffuse);
  const how = odd?.textured ? 'textured' : 'not diffuse';
  if (odd) return `the adapter brings diffuse surfaces of one colour, and '${odd.name}' is ${how}`;
}

/** Return whether a point is within a convex mesh. */
export function inside({ positions, normals }, point) {
  for (let i = 0; i < positions.length; i += 9)
    if ([0, 1, 2].reduce((sum, k) => sum + normals[i + k] * (point[k] - positions[i + k]), 0) > 0)
      return false;
  return true;
}

/** The user's mistake: a scene or a setting that the engine cannot have. */
export class Refused extends Error {
  refused = true;
}

/** Return a number with six digits: what is printed of a setting is what was set. */
export const short = value => Number(value.toPrecision(6));

/**
 * Return where fog and view end [m]: behind the last mesh and four times the farthest lamp, or
 * where exp(-8) is left.
 */
function farthest(camera, lights, meshes, medium) {
  const distance = (list, i) => Math.hypot(...[0, 1, 2].map(k => list[i + k] - camera.position[k]));
  let reach = 0;
  for (const { positions } of meshes)
    for (let i = 0; i < positions.length; i += 3) reach = Math.max(reach, distance(positions, i));
  for (const light of lights)
    if (light.kind !== 'directional') reach = Math.max(reach, 4 * distance(light.position, 0));
  const thick = medium?.sigma_t ? 8 / Math.min(...medium.sigma_t) : Infinity;
  return short(Math.min(1.01 * reach || Infinity, thick, 1e4));
}

function parse(glb) {
  const view = new DataView(glb),
    length = view.getUint32(12, true);
  return {
    gltf: JSON.parse(new TextDecoder().decode(new Uint8Array(glb, 20, length))),
    blob: glb.slice(28 + length),
  };
}

function accessor(gltf, blob, index) {
  const { bufferView, byteOffset = 0, componentType, count, type } = gltf.accessors[index];
  const Kind = { 5126: Float32Array, 5125: Uint32Array, 5123: Uint16Array }[componentType];
  return new Kind(
    blob,
    (gltf.bufferViews[bufferView].byteOffset ?? 0) + byteOffset,
    count * { SCALAR: 1, VEC3: 3 }[type],
  );
}

/** Return the triangles of a mesh without shared corners; normals are its own, or of the planes. */
function triangles(gltf, blob, mesh) {
  const positions = [],
    normals = [];
  for (const { attributes, indices } of mesh.primitives) {
    const corner = accessor(gltf, blob, attributes.POSITION),
      order = accessor(gltf, blob, indices);
    const smooth = attributes.NORMAL === undefined ? null : accessor(gltf, blob, attributes.NORMAL);
    for (let i = 0; i < order.length; i += 3) {
      const [a, b, c] = [0, 1, 2].map(k => corner.subarray(3 * order[i + k], 3 * order[i + k] + 3));
      positions.push(...a, ...b, ...c);
      for (let k = 0; k < 3; k++)
        normals.push(
          ...(smooth ? smooth.subarray(3 * order[i + k], 3 * order[i + k] + 3) : plane(a, b, c)),
        );
    }
  }
  return { positions: new Float32Array(positions), normals: new Float32Array(normals) };
}

function plane(a, b, c) {
  const u = b.map((x, k) => x - a[k]),
    v = c.map((x, k) => x - a[k]);
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...normal) || 1;
  return normal.map(x => x / length);
}

/** Return a surface, and behind one that reflects on its front alone a black one. */
function sides(mesh) {
  if (mesh.two_sided) return [mesh];
  const turned = list => {
    const out = new Float32Array(list.length);
    for (let i = 0; i < list.length; i += 9)
      for (let k = 0; k < 9; k++) out[i + k] = list[i + 3 * (2 - Math.floor(k / 3)) + (k % 3)];
    return out;
  };
  const back = {
    positions: turned(mesh.positions),
    normals: turned(mesh.normals).map(x => -x),
    reflectance: [0, 0, 0],
  };
  return [mesh, { ...mesh, ...back }];
}
