// The kind of pointer that was used last; before any use, the device's primary one.
let isTouch = matchMedia('(pointer: coarse)').matches;
addEventListener('pointerdown', ({ pointerType }) => (isTouch = pointerType === 'touch'), { capture: true });

export function pointsByTouch(): boolean {
  return isTouch;
}
