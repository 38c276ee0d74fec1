import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { fetchFile } from './scene-files';

// The server sends these pieces, and then neither more nor the end.
function answerWith(...pieces: Uint8Array[]): void {
  vi.stubGlobal('fetch', (_url: string, { signal }: { signal: AbortSignal }) => {
    const body = new ReadableStream({
      start(controller) {
        for (const piece of pieces) controller.enqueue(piece);
        signal.addEventListener('abort', () => controller.error(signal.reason));
      },
    });
    return Promise.resolve(new Response(body));
  });
}

describe('fetchFile', () => {
  beforeEach(() => void vi.useFakeTimers());
  afterEach(() => {
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  it('gives up a connection that has been silent for a minute', async () => {
    answerWith(new Uint8Array(10));
    const failed = expect(fetchFile('http://a/b.glb', 'b.glb', 1000)).rejects.toThrow('b.glb: could not be fetched');
    await vi.advanceTimersByTimeAsync(61_000);
    await failed;
  });

  it('tells its caller of an abort by the caller', async () => {
    answerWith(new Uint8Array(10));
    const ending = new AbortController();
    const failed = expect(fetchFile('http://a/b.glb', 'b.glb', 1000, ending.signal)).rejects.toThrow('no longer needed');
    await vi.advanceTimersByTimeAsync(100);
    ending.abort(new Error('no longer needed'));
    await failed;
  });

  it('is not begun for a caller who has given up', async () => {
    answerWith();
    const ending = new AbortController();
    ending.abort(new Error('no longer needed'));
    await expect(fetchFile('http://a/b.glb', 'b.glb', 1000, ending.signal)).rejects.toThrow('no longer needed');
  });
});
