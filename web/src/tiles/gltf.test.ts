// Every content is a valid glTF asset, so that programs that know nothing of our extensions can open it.
import { validateBytes } from 'gltf-validator';
import { readdirSync, readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';

const kGolden = new URL('../../../tests/golden/', import.meta.url);

function listContents(scene: string): URL[] {
  const tiles = new URL(`${scene}/tiles/`, kGolden);
  return readdirSync(tiles).flatMap((level) =>
    readdirSync(new URL(`${level}/`, tiles)).map((file) => new URL(`${level}/${file}`, tiles)),
  );
}

describe.each(['volume', 'hash', 'mesh'])('the contents of %s', (scene) => {
  it.each(listContents(scene).map((url) => [url.pathname.slice(kGolden.pathname.length), url] as const))(
    'include %s without an error',
    async (_, url) => {
      const report = await validateBytes(new Uint8Array(readFileSync(url)), {
        externalResourceFunction: async (uri) => new Uint8Array(readFileSync(new URL(uri, url))),
      });
      expect(report.issues.messages.filter((message) => message.severity <= 1)).toEqual([]);
      expect(report.info.drawCallCount > 0).toBe(scene === 'mesh');
    },
  );
});

it('finds an error where there is one', async () => {
  const [url] = listContents('mesh');
  const bytes = new Uint8Array(readFileSync(url!));
  const report = await validateBytes(bytes.subarray(0, bytes.length - 4), {});
  expect(report.issues.numErrors).toBeGreaterThan(0);
});
