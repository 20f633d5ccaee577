// SPDX-License-Identifier: BSD-3-Clause
// Writes images as OpenEXR: one part of scan lines, 32-bit floats, not compressed.

/** Return a file of layers by name, each three planes R, G, B with rows from above. */
export function exr(layers, width, height) {
  const channels = Object.entries(layers)
    .flatMap(([layer, planes]) => planes.map((plane, k) => [`${layer}.${'RGB'[k]}`, plane]))
    .sort(([a], [b]) => (a < b ? -1 : 1));
  const names = channels.map(([name]) => Buffer.concat([text(name), ints(2, 0, 1, 1)])); // 2: float
  const box = ints(0, 0, width - 1, height - 1);
  const head = Buffer.concat([
    ints(20000630, 2), // the number of the format, and its version
    attribute('channels', 'chlist', Buffer.concat([...names, Buffer.of(0)])),
    attribute('compression', 'compression', Buffer.of(0)),
    attribute('dataWindow', 'box2i', box),
    attribute('displayWindow', 'box2i', box),
    attribute('lineOrder', 'lineOrder', Buffer.of(0)),
    attribute('pixelAspectRatio', 'float', floats([1])),
    attribute('screenWindowCenter', 'v2f', floats([0, 0])),
    attribute('screenWindowWidth', 'float', floats([1])),
    Buffer.of(0),
  ]);
  const lines = Array.from({ length: height }, (_, row) => {
    const row0 = row * width;
    const data = channels.map(([, plane]) => floats(plane.subarray(row0, row0 + width)));
    return Buffer.concat([ints(row, 4 * width * channels.length), ...data]);
  });
  const table = Buffer.alloc(8 * height);
  const begin = head.length + table.length;
  lines.forEach((line, row) => table.writeBigUInt64LE(BigInt(begin + row * line.length), 8 * row));
  return Buffer.concat([head, table, ...lines]);
}

const ints = (...values) => Buffer.from(Int32Array.from(values).buffer);
const floats = values => Buffer.from(Float32Array.from(values).buffer);
const text = words => Buffer.from(`${words}\0`, 'latin1');
const attribute = (name, type, data) =>
  Buffer.concat([text(name), text(type), ints(data.length), data]);
