// Decodes the images that reports/page/images.py packed: zlib, byte planes, zigzag, prediction. Nothing here draws.
"use strict";

const NAN_CODE = -32768, INFINITE_CODE = 32767;

function bytesOfBase64(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Returns one Int32Array of codes for each plane, modulo 2^bits.
function decodedPlanes(raw, width, height, bits) {
  const count = width * height, bytes = bits / 8, mask = (1 << bits) - 1;
  const decoded = [];
  for (let start = 0; start < raw.length; start += bytes * count) {
    const codes = new Int32Array(count);
    for (let y = 0, i = 0; y < height; y++) {
      let left = 0;
      for (let x = 0; x < width; x++, i++) {
        let zigzag = raw[start + i];
        if (bytes > 1) zigzag |= raw[start + count + i] << 8;
        if (bytes > 2) zigzag |= raw[start + 2 * count + i] << 16;
        left = (left + ((zigzag >>> 1) ^ -(zigzag & 1))) | 0;
        codes[i] = (left + (start ? decoded[0][i] : 0)) & mask;
      }
    }
    decoded.push(codes);
  }
  return decoded;
}

// The radiance of 24-bit codes: the upper bits of float32.
function referenceValues(codes) {
  const bits = new Uint32Array(codes.length);
  for (let i = 0; i < bits.length; i++) bits[i] = codes[i] << 8;
  return new Float32Array(bits.buffer);
}

// The relative differences of 16-bit codes; see difference_codes.
function differenceValues(codes, k, s) {
  const values = new Float32Array(codes.length);
  for (let i = 0; i < values.length; i++) {
    const code = (codes[i] << 16) >> 16;
    if (code === NAN_CODE) values[i] = NaN;
    else if (Math.abs(code) === INFINITE_CODE) values[i] = code * Infinity;
    else values[i] = s * Math.sinh(code / k);
  }
  return values;
}
