// Sorts disjoint boxes into an order in which every ray from the eye meets them.
//
// Two disjoint boxes are separated by some axis-aligned plane. If the eye is on the side of one box, no ray meets the
// other box first. (If two such planes imply opposite orders, no ray meets both boxes.)
import type { Box, Vec3 } from '../tiles/tileset';

// Returns whether `a` must precede `b`: no ray from the eye meets `b` before `a`, and some ray may meet both.
function comesBefore(a: Box, b: Box, eye: Vec3): boolean {
  let before = false;
  for (let axis = 0; axis < 3; ++axis) {
    const slack = 2e-3 * Math.min(a.high[axis] - a.low[axis], b.high[axis] - b.low[axis]); // tolerance for rounded walls
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

// Returns the indices of the boxes in order. If there is no such order, as three boxes can overlap cyclically, the
// order is approximate.
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
