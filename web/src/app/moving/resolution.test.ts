import { describe, expect, it } from 'vitest';
import { Resolution } from './resolution';

// Simulates a machine that takes `milliseconds` for a frame at full resolution, and returns the scale after some frames
// while the camera, or models, move.
function settled(milliseconds: number, motion: 'move' | 'play' = 'move'): number {
  const resolution = new Resolution(40, 100, 300);
  for (let now = 0; now < 100; ++now) {
    if (motion === 'move') resolution.moved(now);
    else resolution.played(now);
    resolution.took(milliseconds * resolution.scale(now) ** 2, motion);
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

  it('is full when the camera rests', () => {
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
      resolution.took(60, resolution.motion(now));
    }
    expect(resolution.motion(100)).toBe('move');
    expect(resolution.scale(100)).toBeLessThan(1);
    resolution.played(400);
    expect(resolution.motion(400)).toBe('play');
    expect(resolution.scale(400)).toBe(1);
    expect(resolution.motion(800)).toBe('rest');
  });

  it('rises again after slow frames although the screen refreshes only every 17 ms', () => {
    const resolution = new Resolution(40, 100, 300);
    const draw = (pictures: number, milliseconds: number) => {
      for (let now = 0; now < pictures; ++now) {
        resolution.moved(now);
        resolution.took(Math.max(16.7, milliseconds * resolution.scale(now) ** 2), 'move');
      }
      return resolution.scale(pictures);
    };
    expect(draw(20, 2000)).toBe(0.25);
    expect(draw(1000, 10)).toBe(1);
  });

  it('stays at the minimum if frames are too slow even there', () => {
    const resolution = new Resolution(40, 100, 300);
    for (let now = 0; now < 1000; ++now) {
      resolution.moved(now);
      resolution.took(200, 'move');
    }
    expect(resolution.scale(1000)).toBe(0.25);
  });

  // Simulates a headset that shows a frame every 14 ms, or every 28 ms if rendering takes longer.
  function inHeadset(milliseconds: number, pictures: number): number[] {
    const resolution = new Resolution();
    resolution.pace = { target: 18, patience: 50, share: 0.5 };
    return Array.from({ length: pictures }, (_, now) => {
      resolution.moved(now);
      const scale = resolution.scale(now);
      resolution.took(14 * Math.ceil((milliseconds * scale ** 2) / 14), 'move');
      return scale;
    });
  }

  it('is raised on trial if frame times are limited by the display', () => {
    const quick = inHeadset(10, 500);
    expect(quick[0]).toBe(0.5);
    expect(quick[499]).toBe(1);
    const slow = inHeadset(20, 3000);
    expect(Math.max(...slow)).toBe(1);
    // The interval between trials increases.
    expect(slow.slice(1000).filter((scale) => scale === 1).length).toBeLessThan(40);
    expect(slow.slice(1000).filter((scale) => scale === 0.75).length).toBeGreaterThan(1900);
  });
});
