import { beforeEach, describe, expect, it, vi } from 'vitest';
import { FrameRate } from './frame-rate';

describe('the frame rate', () => {
  let waiting: Map<number, () => void>;
  let said: string[];
  let rate: FrameRate;

  beforeEach(() => {
    let last = 0;
    waiting = new Map();
    vi.stubGlobal('requestAnimationFrame', (act: () => void) => {
      waiting.set(++last, act);
      return last;
    });
    vi.stubGlobal('cancelAnimationFrame', (id: number) => waiting.delete(id));
    said = [];
    rate = new FrameRate((text) => said.push(text));
  });

  // Simulates an animation frame `milliseconds` after the last one, in which a frame is drawn.
  function frame(milliseconds?: number): void {
    const now = [...waiting.values()];
    waiting.clear();
    for (const act of now) act();
    if (milliseconds !== undefined) rate.drew(milliseconds);
  }

  it('is that of consecutive frames', () => {
    frame(500);
    expect(said).toEqual([]);
    frame(20);
    frame(4);
    expect(said).toEqual(['20 ms, 50 fps', '4.0 ms, 250 fps']);
  });

  it('is unknown at rest and for the first frame after it', () => {
    frame(16);
    frame(20);
    frame();
    frame();
    expect(said).toEqual(['20 ms, 50 fps', 'at rest']);
    frame();
    frame(16);
    frame();
    frame();
    expect(said).toEqual(['20 ms, 50 fps', 'at rest', 'at rest']);
    expect(waiting.size).toBe(0);
  });

  it('ignores the time while the page is hidden', () => {
    frame(16);
    frame(20);
    rate.rest();
    frame(60000);
    frame(25);
    expect(said).toEqual(['20 ms, 50 fps', 'at rest', '25 ms, 40 fps']);
  });
});
