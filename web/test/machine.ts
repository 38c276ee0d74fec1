// The environment of the browser tests: the program, its server with real tiles, and Debian's Chromium.
import { spawn, spawnSync, type ChildProcess } from 'node:child_process';
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { chromium, type Browser } from 'playwright-core';

const root = fileURLToPath(new URL('../../', import.meta.url));
export const program = process.env.TESSERA ?? `${root}build/release/apps/tessera/tessera`;
export const goldenScene = `${root}tests/golden/volume`;
export const goldenHash = `${root}tests/golden/hash`;
export const goldenMesh = `${root}tests/golden/mesh`;
export const viewer = `${root}web/dist`;
const chromiumPath = process.env.TESSERA_CHROMIUM ?? '/usr/bin/chromium';

// Returns why the tests cannot run, or undefined if they can. With TESSERA_REQUIRE_BROWSER it throws instead.
export function missing(): string | undefined {
  const needed = [program, `${viewer}/headless.html`, chromiumPath].find((path) => !existsSync(path));
  if (needed !== undefined && process.env.TESSERA_REQUIRE_BROWSER) throw new Error(`${needed} is missing`);
  return needed;
}

export interface Server {
  url: string;
  close(): void;
}

export async function serve(scene: string, folder = viewer): Promise<Server> {
  const server: ChildProcess = spawn(program, ['serve', scene, '--viewer', folder, '--port', '0']);
  const url = await new Promise<string>((resolve, reject) => {
    let said = '';
    const hear = (text: Buffer) => {
      said += text.toString();
      const match = /http:\S+/.exec(said);
      if (match) resolve(match[0]);
    };
    server.stdout!.on('data', hear);
    server.stderr!.on('data', hear);
    server.on('exit', () => reject(new Error(said)));
  });
  return { url, close: () => void server.kill('SIGKILL') };
}

export type GpuKind = 'opengl' | 'swiftshader';

// Uses Mesa's OpenGL on a display (Xvfb suffices), and the slower SwiftShader without one.
export function launch(gpu: GpuKind = process.env.DISPLAY === undefined ? 'swiftshader' : 'opengl'): Promise<Browser> {
  const isOnScreen = gpu === 'opengl';
  const flags = isOnScreen ? ['--use-angle=gl', '--ignore-gpu-blocklist'] : ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
  return chromium.launch({ executablePath: chromiumPath, headless: !isOnScreen, args: ['--no-sandbox', ...flags] });
}

export function run(...words: string[]): void {
  const { status, stderr } = spawnSync(program, words, { encoding: 'utf8' });
  if (status !== 0) throw new Error(stderr);
}
