import { afterEach, describe, expect, it, vi } from 'vitest';
import { FetchedFiles } from './fetched-files';

describe("the files of a world's models", () => {
  const asked: string[] = [];
  vi.stubGlobal('fetch', async (url: string) => {
    asked.push(url);
    return new Response('x'.repeat(10), { status: url.includes('lost') ? 404 : 200 });
  });
  afterEach(() => (asked.length = 0));

  it('are fetched once each', async () => {
    const files = new FetchedFiles('world.json', 'https://a/w/world.json');
    const [one, same] = await Promise.all(['b c.png', 'https://a/w/b c.png'].map((path) => files.file(path, '')));
    expect([one!.path, same!.path, same!.file]).toEqual(['b c.png', 'https://a/w/b c.png', one!.file]);
    for (let i = 0; i < 2; ++i) await expect(files.file('lost', '')).rejects.toThrow('lost: the server answered 404; put it where the world says');
    expect(asked).toEqual(['https://a/w/b%20c.png', 'https://a/w/lost']);
    expect(await new FetchedFiles('world.json', undefined).file('b', '')).toBeUndefined();
  });

  it('are fetched up to a number of files and a total size', async () => {
    const said = async (maximum: { files: number; bytes: number }) => {
      const files = new FetchedFiles('world.json', 'https://a/', maximum);
      for (const [i, path] of ['a', 'b', 'c'].entries()) await files.file(path, `models[${i}]`);
    };
    await said({ files: 3, bytes: 30 });
    await expect(said({ files: 2, bytes: 30 })).rejects.toThrow('world.json: models[2]: needs more than 2 files of models; keep fewer models');
    await expect(said({ files: 3, bytes: 29 })).rejects.toThrow('world.json: models[2]: needs more than 0 kB of models; keep fewer models, or smaller ones');
  });
});
