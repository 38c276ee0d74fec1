// Boxes that do not overlap, in an order in which every ray from the eye meets them.
//
// Two of them lie on two sides of some plane across an axis. Where the eye is on the side of one, no ray meets the other
// first. (Where two planes say the opposite, no ray meets both.)
import type { Box, Vec3 } from '../tiles/tileset';

// Whether no ray from the eye may meet `b` before `a`, and some may meet both.
function comesBefore(a: Box, b: Box, eye: Vec3): boolean {
  let before = false;
  for (let axis = 0; axis < 3; ++axis) {
    const slack = 2e-3 * Math.min(a.high[axis] - a.low[axis], b.high[axis] - b.low[axis]); // rounding of walls
    if (a.high[axis] <= b.low[axis] + slack) {
      if (eye[axis] >= b.low[axis]) return false;
      before ||= eye[axis] <= a.high[axis];
    } else if (b.high[axis] <= a.low[axis] + slack) {
      if (eye[axis] <= b.high[axis]) return false;
      before ||= eye[axis] >= a.low[axis];
    }
  }
  return before;
}

// The numbers of the boxes. Where there is no such order, as three boxes can lie around one another, one that is nearly.
export function frontToBack(boxes: Box[], eye: Vec3): number[] {
  const behind = boxes.map((): number[] => []);
  const waitsFor = boxes.map(() => 0);
  boxes.forEach((a, i) =>
    boxes.forEach((b, j) => {
      if (i === j || !comesBefore(a, b, eye)) return;
      behind[i].push(j);
      ++waitsFor[j];
    }),
  );
  const order: number[] = [];
  const waiting = new Set(boxes.keys());
  while (waiting.size > 0) {
    let next = -1;
    for (const i of waiting) if (next === -1 || waitsFor[i] < waitsFor[next]) next = i;
    waiting.delete(next);
    order.push(next);
    for (const j of behind[next]) --waitsFor[j];
  }
  return order;
}
