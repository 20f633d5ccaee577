// SPDX-License-Identifier: BSD-3-Clause
// Finds what adapters for browsers need: Chromium, and the packages of the engines.
import { spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

/** A reason to end, with the exit status; the statuses are those of airlight. */
export class Ended extends Error {
  constructor(status, words) {
    super(words);
    this.status = status;
  }
}
export const FAILED = 1;
export const WRONG = 2;
export const MISSING = 3;

/** The folder of the adapters. */
export const HERE = path.dirname(fileURLToPath(import.meta.url));
export const isRoot = process.getuid?.() === 0;
const LISTS = ['package.json', 'package-lock.json'];

const debian = name => `\`${isRoot ? '' : 'sudo '}apt-get install -y ${name}\` on Debian`;

/** Return the file of a Chromium. */
export function findChromium() {
  const named = process.env.AIRLIGHT_CHROMIUM;
  const names = named ? [named] : ['chromium', 'chromium-browser', 'google-chrome', 'chrome'];
  const folders = (process.env.PATH ?? '').split(path.delimiter);
  const places = names.flatMap(name =>
    path.isAbsolute(name) ? [name] : folders.map(folder => path.join(folder, name)),
  );
  const found = places.find(place => fs.existsSync(place));
  if (found) return found;
  const words = `${named ?? 'Chromium'} is missing: ${debian('chromium')}`;
  throw new Ended(MISSING, `${words}, or name one by AIRLIGHT_CHROMIUM`);
}

/** Return the folder of the packages, which npm installs into the user's cache at the first run. */
export function installed(seconds) {
  const lock = fs.readFileSync(path.join(HERE, 'package-lock.json'));
  const digest = createHash('sha256').update(lock).digest('hex').slice(0, 16);
  const base = process.env.XDG_CACHE_HOME || path.join(os.homedir(), '.cache');
  const cache = process.env.AIRLIGHT_CACHE_DIR || path.join(base, 'airlight');
  const folder = path.join(cache, `adapters-${digest}`);
  const modules = path.join(folder, 'node_modules');
  if (fs.existsSync(modules)) return modules;
  // Whole or not there: npm works in a folder beside it, which gets the name when it is done.
  fs.mkdirSync(cache, { recursive: true });
  const unfinished = fs.mkdtempSync(`${folder}.`);
  try {
    for (const name of LISTS) fs.copyFileSync(path.join(HERE, name), path.join(unfinished, name));
    install(unfinished, folder, seconds);
    // Another run may have been faster.
    if (!fs.existsSync(modules)) fs.renameSync(unfinished, folder);
  } finally {
    fs.rmSync(unfinished, { recursive: true, force: true });
  }
  return modules;
}

function install(place, folder, seconds) {
  const words = ['ci', '--ignore-scripts', '--no-audit', '--no-fund', '--prefer-offline'];
  const how = { cwd: place, encoding: 'utf8', timeout: 1000 * seconds };
  const { status, signal, error, stderr } = spawnSync('npm', words, how);
  if (error?.code === 'ENOENT') throw new Ended(MISSING, `npm is missing: ${debian('npm')}`);
  if (status === 0) return;
  const why = /error code (\w+)/.exec(stderr)?.[1] ?? error?.code ?? signal ?? `status ${status}`;
  const lists = LISTS.map(name => path.join(HERE, name)).join(' ');
  const copy = `mkdir -p ${folder} && cp ${lists} ${folder}`;
  throw new Ended(
    MISSING,
    `the packages of the engines are missing, and npm cannot install them (${why}). ` +
      `With a network: \`${copy} && npm ci --ignore-scripts --prefix ${folder}\``,
  );
}
