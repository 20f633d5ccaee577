// Pixels of pictures and error maps, and the scales of the maps.
"use strict";

const MAGENTA = 0xffff00ff;  // as all pixels here: alpha, blue, green, red
const PURPLE = 0xff7a007a;
const STEPS = 16384;
const FLOOR = 1e-4;  // relative error that is white, as in all error maps

// sRGB of linear values in steps of 1 / STEPS, IEC 61966-2-1.
const SRGB = Uint8Array.from({length: STEPS + 1}, (_, i) => {
  const v = i / STEPS;
  return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
});

function encoded(linear) {
  return SRGB[linear >= 1 ? STEPS : linear <= 0 ? 0 : Math.round(linear * STEPS)];
}

// Not finite: magenta and purple diagonals, so that it does not hang on the colour alone.
function hatched(x, y) { return (x + y) % 6 < 3 ? MAGENTA : PURPLE; }

// Draws radiance at(c, i) times a factor; returns how many pixels are not finite.
function drawPicture(canvas, width, height, at, factor) {
  return drawPixels(canvas, width, height, (i, x, y) => {
    const r = at(0, i), g = at(1, i), b = at(2, i);
    if (!(Number.isFinite(r) && Number.isFinite(g) && Number.isFinite(b))) return NaN;
    return 0xff000000 | encoded(b * factor) << 16 | encoded(g * factor) << 8 | encoded(r * factor);
  });
}

function drawPixels(canvas, width, height, colour) {
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  let bad = 0;
  for (let y = 0, i = 0; y < height; y++) {
    for (let x = 0; x < width; x++, i++) {
      const value = colour(i, x, y);
      if (value === value) pixels[i] = value;
      else { pixels[i] = hatched(x, y); bad++; }
    }
  }
  context.putImageData(image, 0, 0);
  return bad;
}

// A colour map of bytes R, G, B as pixels.
function colourTable(base64) {
  const bytes = bytesOfBase64(base64);
  return Uint32Array.from({length: bytes.length / 3}, (_, i) =>
    (0xff000000 | bytes[3 * i + 2] << 16 | bytes[3 * i + 1] << 8 | bytes[3 * i]) >>> 0);
}

// Where a relative error lies between FLOOR and 1 on a scale of decades, 0 to 1.
function decade(size) {
  return Math.min(1, Math.max(0, Math.log10(Math.max(size, 1e-30) / FLOOR) / -Math.log10(FLOOR)));
}

// The error maps by name: the colour of a pixel in the table, and the ticks of the scale as [place, label].
const MAPS = {
  signed: {
    words: "signed relative error: blue too dark, red too bright",
    colour(table, error) {
      const middle = (table.length - 1) / 2;
      return table[Math.round(middle * (1 + Math.sign(error) * decade(Math.abs(error))))];
    },
    ticks() {
      const decades = decadeTicks();
      const up = decades.slice(1).map(([place, label]) => [0.5 + place / 2, "+" + label]);
      const down = decades.slice(1).map(([place, label]) => [0.5 - place / 2, "\u2212" + label]).reverse();
      return [...down, [0.5, "\u00b1" + decades[0][1]], ...up];
    },
  },
  relative: {
    words: "relative error, without its sign",
    colour: (table, error) => table[Math.round(255 * decade(Math.abs(error)))],
    ticks: () => decadeTicks(),
  },
  flip: {
    words: "HDR-FLIP of all light",
    colour: (table, error) => table[Math.round(255 * Math.min(1, error))],
    ticks: () => [0, 0.2, 0.4, 0.6, 0.8, 1].map((value) => [value, String(value)]),
  },
};

function decadeTicks() {
  const decades = Math.round(-Math.log10(FLOOR));
  return Array.from({length: decades + 1}, (_, n) => [n / decades, percentWords(FLOOR * 10 ** n)]);
}

function percentWords(value) {
  return `${Number((100 * value).toPrecision(3))} %`;
}

function superscript(number) {
  const digits = {"-": "\u207b", 0: "\u2070", 1: "\u00b9", 2: "\u00b2", 3: "\u00b3", 4: "\u2074", 5: "\u2075",
    6: "\u2076", 7: "\u2077", 8: "\u2078", 9: "\u2079"};
  return String(number).replace(/./g, (digit) => digits[digit]);
}

// A number in so many significant digits, with a power of ten where it is small or large.
function numberWords(value, digits = 5) {
  if (Number.isNaN(value)) return "not a number";
  if (!Number.isFinite(value)) return value > 0 ? "infinite" : "\u2212infinite";
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e-3 && size < 1e5) return value.toPrecision(digits).replace("-", "\u2212");
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  return `${mantissa.replace("-", "\u2212")}\u00b710${superscript(Number(exponent))}`;
}

// A signed relative error in per cent.
function errorWords(error) {
  if (!Number.isFinite(error)) return "not finite";
  const words = numberWords(100 * error, 3);
  return `${error > 0 ? "+" : ""}${words} %`;
}
