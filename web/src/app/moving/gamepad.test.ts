import { expect, it } from 'vitest';
import { beyondDeadZone, readMotion } from './gamepad';

const still = { value: 0, pressed: false };

it('a gamepad has a dead zone', () => {
  const { right, up, forward, yaw, pitch } = readMotion({ axes: [0.1, -0.05, 0.11, -0.1], buttons: [] });
  expect([right, up, forward, yaw, pitch].map(Math.abs)).toEqual([0, 0, 0, 0, 0]);
});

it('a gamepad moves with its left stick, looks with its right one, and rises and falls with its triggers', () => {
  const buttons = Array.from({ length: 8 }, (_, i) => (i === 7 ? { value: 0.75, pressed: true } : i === 4 ? { value: 1, pressed: true } : still));
  const motion = readMotion({ axes: [1, -1, 1, 1], buttons });
  expect(motion).toEqual({ right: 1, forward: 1, yaw: -1, pitch: -1, up: 0.75, fast: true });
});

it('a stick starts smoothly at the edge of its dead zone', () => {
  expect(beyondDeadZone(0.12)).toBe(0);
  expect(beyondDeadZone(-1)).toBe(-1);
  expect(beyondDeadZone(0.2)).toBeGreaterThan(0);
  expect(beyondDeadZone(0.2)).toBeLessThan(0.02);
});
