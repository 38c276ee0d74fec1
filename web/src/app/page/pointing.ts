// What people point with: what they pointed with last; before that, what the device says.
let isTouch = matchMedia('(pointer: coarse)').matches;
addEventListener('pointerdown', ({ pointerType }) => (isTouch = pointerType === 'touch'), { capture: true });

export function pointsByTouch(): boolean {
  return isTouch;
}
