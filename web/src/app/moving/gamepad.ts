// Reads the first gamepad in its standard layout.

// Shares of full speed, from -1 to 1; yaw to the left, pitch upwards.
export interface Motion {
  right: number;
  up: number;
  forward: number;
  yaw: number;
  pitch: number;
  fast: boolean;
}

const kDead = 0.12; // dead zone: sticks do not return to exactly 0
const kStill: Motion = { right: 0, up: 0, forward: 0, yaw: 0, pitch: 0, fast: false };

// Starts smoothly at the edge of the dead zone.
export function beyondDeadZone(value: number): number {
  const beyond = (Math.abs(value) - kDead) / (1 - kDead);
  return beyond <= 0 ? 0 : Math.sign(value) * Math.min(beyond, 1) ** 2;
}

export function padMotion(): Motion {
  const pad = navigator.getGamepads?.().find((one) => one?.connected && one.mapping === 'standard');
  return pad ? readMotion(pad) : kStill;
}

// Left stick: move. Right stick: look. Triggers: down and up. Left bumper: faster.
export function readMotion({ axes, buttons }: { axes: readonly number[]; buttons: readonly { value: number; pressed: boolean }[] }): Motion {
  const axis = (i: number) => beyondDeadZone(axes[i] ?? 0);
  return {
    right: axis(0), forward: -axis(1) + 0, yaw: -axis(2) + 0, pitch: -axis(3) + 0,
    up: (buttons[7]?.value ?? 0) - (buttons[6]?.value ?? 0),
    fast: buttons[4]?.pressed ?? false,
  };
}
