import { describe, expect, it } from 'vitest';
import { Resolution } from './resolution';

// A machine that takes so long for a whole picture: the scale after some pictures while the camera moves, or models do.
function settled(milliseconds: number, pace: 'move' | 'play' = 'move'): number {
  const resolution = new Resolution(40, 100, 300);
  for (let now = 0; now < 100; ++now) {
    if (pace === 'move') resolution.moved(now);
    else resolution.played(now);
    resolution.took(milliseconds * resolution.scale(now) ** 2, pace);
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
    const resolution = new Resolution(40, 100, 300);
    for (let now = 0; now < 10; ++now) {
      resolution.moved(now);
      resolution.took(1000, 'move');
    }
    expect(resolution.scale(100)).toBe(0.25);
    expect(resolution.scale(400)).toBe(1);
  });

  it('is higher while models alone move, and not lowered by what the camera did before', () => {
    expect(settled(60, 'play')).toBe(1);
    expect(settled(130, 'play')).toBe(0.75);
    expect(settled(1e4, 'play')).toBe(0.25);
    const resolution = new Resolution(40, 100, 300);
    for (let now = 0; now < 10; ++now) {
      resolution.moved(now);
      resolution.played(now);
      resolution.took(60, resolution.pace(now));
    }
    expect(resolution.pace(100)).toBe('move');
    expect(resolution.scale(100)).toBeLessThan(1);
    resolution.played(400);
    expect(resolution.pace(400)).toBe('play');
    expect(resolution.scale(400)).toBe(1);
    expect(resolution.pace(800)).toBe('rest');
  });
});
