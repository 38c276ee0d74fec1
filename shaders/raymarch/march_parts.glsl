// Marches a pixel's ray through a content.
// Reads: march_part.glsl; view.glsl; Part fetchPart(uint), Place placeOfPart(uint); float minTransmittance. Defines:
// marchContent(), storeSurfaceBehind().

// Marches the pieces of `range` that lie in none of the first `boxes` hidden boxes. Boxes are cut out of rays, along which
// lengths are in scene units even where space is contracted.
void marchShown(ViewArguments view, uint boxes, Part part, vec3 o, vec3 d, vec2 range, inout Composite sum) {
  float t = range.x;
  uint guard = 0;
  do {
    float exit = t, next = range.y;  // exit: end of the boxes that contain t; next: start of the nearest box after t
    for (uint n = 0; n < boxes; ++n) {
      const vec2 hidden = clipToBox(boxPosition(view, n, o), boxDirection(view, n, d), vec3(-0.5), vec3(0.5), range);
      if (hidden.x >= hidden.y || hidden.y <= t) continue;
      if (hidden.x <= t) exit = max(exit, hidden.y);
      else next = min(next, hidden.x);
    }
    if (exit == t) {
      marchPart(part, o, d, vec2(t, next), sum);
      exit = next;
    }
    t = exit;
  } while (t < range.y && sum.transmittance >= minTransmittance && ++guard < 2 * boxes + 1);
}

// Marches the part of the ray that the content owns, part by part in the order in which the ray enters them.
void marchParts(ViewArguments view, vec3 o, vec3 d, vec2 whole, uint partCount, inout Composite sum) {
  float entered = 0;  // entry and number of the previous part
  uint last = 0;
  for (uint turn = 0; turn < partCount && sum.transmittance >= minTransmittance; ++turn) {
    uint nearest = partCount;
    vec2 range = vec2(0);
    for (uint n = 0; n < partCount; ++n) {
      const vec2 owned = ownedRange(placeOfPart(n), o, d, whole);
      if (!(owned.x < owned.y)) continue;
      if (turn > 0 && (owned.x < entered || (owned.x == entered && n <= last))) continue;
      if (nearest < partCount && owned.x >= range.x) continue;
      nearest = n;
      range = owned;
    }
    if (nearest == partCount) return;
    marchShown(view, view.boxesOfAll, fetchPart(nearest), o, d, range, sum);
    entered = range.x;
    last = nearest;
  }
}

// `low`, `high`: the box in which the content is drawn. A background block is drawn behind the scene's box, or alone if
// the ray misses the box.
Composite marchContent(ViewArguments view, uint pixel, vec3 d, vec3 low, vec3 high, uint partCount, bool isBackgroundBlock) {
  const vec3 o = toVec3(view.origin);
  const vec2 box = clipToBox(o, d, toVec3(view.low), toVec3(view.high), vec2(view.near, 1e30));
  const bool meetsBox = box.x < box.y;
  const float far = farthestDistance(view, pixel);
  Composite sum = Composite(vec3(0), vec4(0), 1, 0, 0);
  if (isBackgroundBlock) {
    const vec2 behind = vec2(meetsBox ? box.y : view.near, far);
    if (behind.x < behind.y) marchShown(view, view.boxCount, fetchPart(0), o, d, behind, sum);
  } else {
    const vec2 whole = clipToBox(o, d, low, high, vec2(meetsBox ? box.x : view.near, far));
    if (whole.x < whole.y) marchParts(view, o, d, whole, partCount, sum);
  }
  return sum;
}

// Stores the surface of a pixel if it lies in this content: where half of the light is absorbed. `before`: the transmittance
// of the contents in front of this one.
void storeSurfaceBehind(ViewArguments view, uint pixel, float before, Composite sum) {
  if (before < 0.5 || before * sum.transmittance >= 0.5) return;
  storeSurface(view, pixel, sum.median > 0 ? sum.median : sum.depth / (1 - sum.transmittance));
}
