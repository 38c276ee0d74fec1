import { describe, expect, it } from 'vitest';
import { Resolution } from './resolution';

// A machine that takes so long for a whole picture: the scale after some pictures while the camera moves.
function settled(milliseconds: number): number {
  const resolution = new Resolution(40, 300);
  for (let now = 0; now < 100; ++now) {
    resolution.moved(now);
    resolution.took(milliseconds * resolution.scale(now) ** 2);
  }
  return resolution.scale(100);
}

describe('the resolution', () => {
  it('is as high as the machine can while the camera moves', () => {
    expect(settled(5)).toBe(1);
    expect(settled(60)).toBe(0.75);
    expect(settled(130)).toBe(0.5);
    expect(settled(1e4)).toBe(0.25);
  });

  it('is whole when the camera rests', () => {
    const resolution = new Resolution(40, 300);
    for (let now = 0; now < 10; ++now) {
      resolution.moved(now);
      resolution.took(1000);
    }
    expect(resolution.scale(100)).toBe(0.25);
    expect(resolution.scale(400)).toBe(1);
  });
});
